//! Figures and pictures for people and machines: reports, tables, false-colour pictures, text in pictures.

pub mod bake;
pub mod baked;
pub mod canvas;
pub mod colormap;
pub mod diff;
pub mod error;
pub mod font;
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
pub mod sweep;
pub mod table;
pub mod text;
pub mod ticks;
