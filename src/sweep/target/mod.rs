//! The coarsest grid whose error is no larger than was asked for: bake, measure, predict, bake again.
//!
//! [`rule`] chooses the next bake from those that were measured, [`align`] moves its grid to where walls are, [`search`] makes
//! them.

mod align;
pub mod rule;
pub mod search;
