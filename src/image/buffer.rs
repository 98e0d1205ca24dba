//! The image inside the program.

use glam::Vec3;

/// One channel of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// `R`, or with its layer `hires.R`.
    pub name: String,
    /// One value per pixel, row by row from the top.
    pub values: Vec<f32>,
}

/// Linear image of named channels, stored one channel after the other (planar), so that a layer is added without
/// moving what is there.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    width: u32,
    height: u32,
    channels: Vec<Channel>,
}

impl Image {
    /// An image of `width * height` pixels that has no channel yet.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, channels: Vec::new() }
    }

    /// Pixels per row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Number of pixels, which is the length of every channel.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The channels in the order in which they were added.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Values of the channel of this name.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|channel| channel.name == name).map(|channel| channel.values.as_slice())
    }

    /// Adds a channel.
    ///
    /// # Panics
    /// If there is not one value per pixel, or the name is taken: both are mistakes of the calling code, no file or
    /// option leads here.
    pub fn push(&mut self, name: impl Into<String>, values: Vec<f32>) {
        let name = name.into();
        assert_eq!(values.len(), self.pixels(), "channel {name} needs one value per pixel");
        assert!(self.channel(&name).is_none(), "channel {name} is there already");
        self.channels.push(Channel { name, values });
    }

    /// Adds `R`, `G`, `B` of a layer; the layer `""` is the image proper. Panics as [`Image::push`] does.
    pub fn push_rgb(&mut self, layer: &str, values: &[Vec3]) {
        for (band, letter) in ["R", "G", "B"].into_iter().enumerate() {
            self.push(in_layer(layer, letter), values.iter().map(|rgb| rgb[band]).collect());
        }
    }

    /// The three bands of a layer; the layer `""` is the image proper.
    pub fn rgb(&self, layer: &str) -> Option<[&[f32]; 3]> {
        let band = |letter| self.channel(&in_layer(layer, letter));
        Some([band("R")?, band("G")?, band("B")?])
    }

    /// `R`, `G`, `B`; a lone channel stands for all three.
    pub fn rgb_or_grey(&self) -> Option<[&[f32]; 3]> {
        match (self.rgb(""), self.channels.as_slice()) {
            (Some(rgb), _) => Some(rgb),
            (None, [grey]) => Some([&grey.values; 3]),
            (None, _) => self.channel("Y").map(|grey| [grey; 3]),
        }
    }
}

fn in_layer(layer: &str, channel: &str) -> String {
    if layer.is_empty() { channel.to_owned() } else { format!("{layer}.{channel}") }
}
