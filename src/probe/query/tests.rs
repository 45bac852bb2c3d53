//! Tests of the query on volumes built in code.
//!
//! [`furnace`] knows the answer under every combination of settings; [`by_hand`] knows it for each formula alone.

mod by_hand;
mod fixture;
mod furnace;
