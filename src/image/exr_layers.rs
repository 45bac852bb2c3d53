//! The layers of OpenEXR parts, by the names of their channels.

use std::collections::BTreeMap;
use std::path::Path;

use exr::meta::header::Header;
use glam::{DMat3, DVec2};

use super::error::ImageError;
use crate::math::primaries::Primaries;

/// Name of the plain channels R, G, B (or Y) as a layer, while a file is being read.
pub(super) const PLAIN: &str = "";

/// Most names in a message.
const MAX_NAMES: usize = 40;

/// A layer of any part.
pub(super) struct PartLayer {
    pub part: usize,
    /// Name of the part, in files of several.
    part_name: Option<String>,
    /// As in [`layers_of`].
    name: String,
    /// Indices of R, G and B among the channels of the part.
    pub channels: [usize; 3],
}

impl PartLayer {
    /// The layers of all parts, in the order of parts and names.
    pub(super) fn all(headers: &[Header]) -> Vec<PartLayer> {
        let of_part = |(part, header): (usize, &Header)| {
            let part_name = header.own_attributes.layer_name.as_ref().map(ToString::to_string);
            let layer = move |(name, channels)| PartLayer { part, part_name: part_name.clone(), name, channels };
            layers_of(header).into_iter().map(layer)
        };
        headers.iter().enumerate().flat_map(of_part).collect()
    }

    pub(super) fn is_plain(&self) -> bool {
        self.name == PLAIN
    }

    /// Whether a user may mean this layer: by its own name, by its part's if it is plain, or by both with a dot.
    pub(super) fn is_called(&self, name: &str) -> bool {
        let in_part = |part: &String| match self.is_plain() {
            true => name == part,
            false => name.strip_prefix(part.as_str()).and_then(|rest| rest.strip_prefix('.')) == Some(&self.name),
        };
        (!self.is_plain() && self.name == name) || self.part_name.as_ref().is_some_and(in_part)
    }

    /// A name by which it [is called](PartLayer::is_called). `None` if it has none.
    fn title(&self) -> Option<&str> {
        if self.is_plain() { self.part_name.as_deref() } else { Some(&self.name) }
    }
}

/// The layers of a part: from the name to the indices of R, G and B in the file. A layer whose only colour is Y is grey;
/// its index stands three times.
pub(super) fn layers_of(header: &Header) -> BTreeMap<String, [usize; 3]> {
    let mut found: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for (place, channel) in header.channels.list.iter().enumerate() {
        let name = channel.name.to_string();
        let (layer, letter) = name.rsplit_once('.').unwrap_or((PLAIN, &name));
        found.entry(layer.to_owned()).or_default().insert(letter.to_owned(), place);
    }
    let colored = |(name, letters): (String, BTreeMap<String, usize>)| {
        let place = |letter: &str| letters.get(letter).copied();
        let rgb = || Some([place("R")?, place("G")?, place("B")?]);
        // Y beside X or RY is no grey.
        let grey = || Some([place("Y").filter(|_| letters.keys().all(|letter| letter == "Y" || letter == "A"))?; 3]);
        Some((name, rgb().or_else(grey)?))
    };
    found.into_iter().filter_map(colored).collect()
}

/// The matrix that takes the colours of a part to Rec. 709.
pub(super) fn rec_709_from_rgb(path: &Path, header: &Header) -> Result<DMat3, ImageError> {
    let Some(found) = header.shared_attributes.chromaticities else { return Ok(DMat3::IDENTITY) };
    let [red, green, blue, white] =
        [found.red, found.green, found.blue, found.white].map(|xy| DVec2::new(f64::from(xy.x()), f64::from(xy.y())));
    Primaries { red, green, blue, white }.rec_709_from_rgb().ok_or_else(|| ImageError::NotLight {
        path: path.to_owned(),
        reason: format!("its attribute `chromaticities` holds no primaries of colour: {found:?}"),
        remedy: "export it with those of Rec. 709, or without",
    })
}

/// The error of a file in which nothing has colour.
pub(super) fn no_color(path: &Path, headers: &[Header]) -> ImageError {
    let channels = headers.iter().flat_map(|header| &header.channels.list).map(|channel| channel.name.to_string());
    ImageError::NoColor { path: path.to_owned(), channels: listed(channels) }
}

/// The error of a file that has colour, but not under this name, or under several and none was given.
pub(super) fn no_layer(path: &Path, wanted: Option<&str>, layers: &[PartLayer]) -> ImageError {
    let fault = match wanted {
        Some(wanted) => format!("it has no layer '{}'", wanted.escape_debug()),
        None => "it has no plain channels R, G and B, but several layers".to_owned(),
    };
    let path = path.to_owned();
    let mut titles: Vec<String> = layers.iter().filter_map(|layer| layer.title().map(str::to_owned)).collect();
    titles.dedup();
    match titles.is_empty() {
        true => ImageError::NotLight { path, reason: format!("{fault} and no others"), remedy: "leave its name out" },
        false => ImageError::NoLayer { path, fault, layers: listed(titles.into_iter()) },
    }
}

/// Names for a message of one line.
fn listed(names: impl Iterator<Item = String>) -> String {
    let names: Vec<String> = names.map(|name| name.escape_debug().to_string()).collect();
    let shown = names[..names.len().min(MAX_NAMES)].join(", ");
    match names.len() - names.len().min(MAX_NAMES) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}
