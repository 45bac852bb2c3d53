//! The machine around the program: input and output files, memory, signals, progress bars, and numbers as text.

pub mod format;
pub mod input;
pub mod interrupt;
pub mod journal;
pub mod memory;
pub mod output;
pub mod processor;
pub mod progress;
pub mod terminal;
