//! Tests of the query on volumes built in code.
//!
//! [`furnace`] knows the answer under every combination of settings; [`by_hand`], [`corners`], [`ddgi`] and [`eccentric`]
//! know it for each formula alone.

mod by_hand;
mod corners;
mod ddgi;
mod eccentric;
mod fixture;
mod furnace;
mod march;
