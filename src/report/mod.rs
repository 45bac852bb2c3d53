//! Figures and pictures for people and machines: reports, tables, false-colour pictures, text in pictures.

pub mod air;
pub mod bake;
pub mod baked;
pub mod colormap;
pub mod diff;
pub mod draw;
pub mod error;
pub mod gate;
pub mod header;
pub mod heatmap;
pub mod leak;
pub mod legend;
pub mod page;
pub mod plot;
pub mod probe_key;
pub mod reference;
pub mod reference_layers;
pub mod render;
pub mod sheet;
pub mod sweep;
pub mod sweep_page;
pub mod table;
pub mod target;
pub mod ticks;
pub mod words;
