//! What must hold of the page whatever the report says.
