//! The page of a comparison in a real browser: what it draws, how it is driven, and that it asks nothing of any network.
//!
//! Needs Chromium or Chrome: `CHROME` names one, else it is looked for on the path; where there is none, each test says so and
//! passes. `LIGHTPROBE_PAGE_SHOTS=DIR` keeps screenshots.

mod browser;
mod fixture;

mod driving;
mod layout;
mod weight;
