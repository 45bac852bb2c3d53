//! Layouts by hand-computed texels, and look-ups against the engines' shaders, written down a second time.

mod bevy;
mod ddgi;
mod fixture;
mod made;
mod rooms;
mod three;
