//! The IESNA methods and the closed forms they rest on.
