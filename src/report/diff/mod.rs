//! Two results compared: figures, gates, verdict.

pub mod gate;
