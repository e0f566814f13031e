//! Geometric paths, and set-points along them at a limited feed.
