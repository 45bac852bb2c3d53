//! The machine around the program: input and output files, memory, progress bars, and numbers as text.

pub mod format;
pub mod input;
pub mod interrupt;
pub mod memory;
pub mod output;
pub mod progress;
pub mod terminal;
