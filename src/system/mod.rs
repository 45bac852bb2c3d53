//! The machine around the program: files in and out, memory, progress, numbers as people read them.

pub mod format;
pub mod input;
pub mod memory;
pub mod output;
pub mod progress;
