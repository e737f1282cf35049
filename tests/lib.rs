//! Nothing: this package holds tests and benchmarks that use several physics crates.
