//! Nothing: the features of its dependencies are all that matters.
