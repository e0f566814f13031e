//! Look-ahead and feed planning of part programs.

mod corners;
mod deviation;
mod feed_override;
mod five_axis;
mod global_optimum;
mod limits;
mod memory;
mod monotony;
mod optimum;
mod profile;
mod programs;
mod random;
mod short_motions;
mod speed_search;
mod splines;
mod timeline;
mod trapezoid;
