//! Materials: Lambertian colours, and the few that shine. Reflectances are linear RGB and stay below 0.9.

/// A Lambertian material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint {
    /// Name in the file; the same name is the same material.
    pub name: &'static str,
    /// Linear reflectance.
    pub color: [f32; 3],
    /// Emitted radiance of the front face, W/(sr m^2).
    pub emission: [f32; 3],
    /// Whether it is a sheet without thickness.
    pub sheet: bool,
}

/// An opaque solid.
pub const fn solid(name: &'static str, r: f32, g: f32, b: f32) -> Paint {
    Paint { name, color: [r, g, b], emission: [0.0; 3], sheet: false }
}

/// A thin sheet with two faces.
pub const fn sheet(name: &'static str, r: f32, g: f32, b: f32) -> Paint {
    Paint { name, color: [r, g, b], emission: [0.0; 3], sheet: true }
}

/// A light source.
const fn source(name: &'static str, emission: [f32; 3]) -> Paint {
    Paint { name, color: [0.0; 3], emission, sheet: false }
}

/// Walls and ceiling. The only paint that differs between the two environments: `colour` is its hue, of mean 1, and
/// [`crate::reflectance`] finds the factor.
pub const WALL: Paint = solid("wall paint", 1.03, 1.0, 0.97);

/// Ceiling luminaires, warm white.
pub const CEILING_LIGHT: Paint = source("ceiling light", [14.0, 12.6, 10.6]);
/// Desk lamp, warmer.
pub const LAMP_LIGHT: Paint = source("lamp light", [16.0, 12.0, 8.0]);
/// Overcast sky behind the window.
pub const SKY: Paint = source("sky", [1.4, 1.6, 1.9]);

pub const CARPET: Paint = solid("carpet", 0.29, 0.30, 0.33);
pub const SKIRTING: Paint = solid("skirting", 0.72, 0.70, 0.66);
pub const FIXTURE: Paint = solid("luminaire enamel", 0.85, 0.85, 0.84);
pub const OAK: Paint = solid("oak", 0.46, 0.29, 0.15);
pub const BEECH: Paint = solid("beech", 0.60, 0.44, 0.27);
pub const WALNUT: Paint = solid("walnut", 0.23, 0.13, 0.075);
pub const DOOR: Paint = solid("door", 0.50, 0.35, 0.21);
pub const STEEL: Paint = solid("steel", 0.48, 0.48, 0.47);
pub const DARK_STEEL: Paint = solid("dark steel", 0.13, 0.13, 0.14);
pub const BRASS: Paint = solid("brass", 0.55, 0.40, 0.16);
pub const CABINET: Paint = solid("cabinet grey", 0.40, 0.42, 0.41);
pub const WHITE: Paint = solid("white enamel", 0.80, 0.80, 0.78);
pub const BLACK: Paint = solid("black plastic", 0.035, 0.035, 0.037);
pub const RUBBER: Paint = solid("rubber", 0.05, 0.05, 0.05);
pub const PUTTY: Paint = solid("putty plastic", 0.60, 0.55, 0.45);
pub const PUTTY_DARK: Paint = solid("dark putty plastic", 0.36, 0.33, 0.28);
pub const KEY: Paint = solid("key", 0.68, 0.64, 0.55);
pub const KEY_GREY: Paint = solid("grey key", 0.38, 0.36, 0.32);
pub const SCREEN: Paint = solid("screen", 0.045, 0.055, 0.06);
pub const SCREEN_TEXT: Paint = solid("screen text", 0.30, 0.62, 0.38);
pub const SCREEN_BAR: Paint = solid("screen bar", 0.20, 0.32, 0.55);
pub const FABRIC: Paint = solid("blue fabric", 0.09, 0.14, 0.25);
pub const FABRIC_RED: Paint = solid("red fabric", 0.36, 0.10, 0.08);
pub const RUG: Paint = solid("rug", 0.33, 0.11, 0.09);
pub const RUG_BAND: Paint = solid("rug band", 0.52, 0.41, 0.26);
pub const CORK: Paint = solid("cork", 0.50, 0.33, 0.18);
pub const TERRACOTTA: Paint = solid("terracotta", 0.48, 0.20, 0.11);
pub const EARTH: Paint = solid("earth", 0.08, 0.055, 0.04);
pub const STEM: Paint = solid("stem", 0.20, 0.30, 0.09);
pub const LEAF: Paint = sheet("leaf", 0.09, 0.30, 0.06);
pub const LEAF_LIGHT: Paint = sheet("light leaf", 0.20, 0.42, 0.09);
pub const LEAF_DRY: Paint = sheet("dry leaf", 0.42, 0.36, 0.10);
pub const PAPER: Paint = sheet("paper", 0.80, 0.79, 0.75);
pub const PAPER_YELLOW: Paint = sheet("yellow paper", 0.80, 0.70, 0.22);
pub const PAPER_BLUE: Paint = sheet("blue paper", 0.42, 0.58, 0.74);
pub const PAPER_PINK: Paint = sheet("pink paper", 0.78, 0.46, 0.48);
pub const CRUMPLED: Paint = solid("crumpled paper", 0.78, 0.77, 0.73);
pub const PAGES: Paint = solid("pages", 0.70, 0.65, 0.53);
pub const BLIND: Paint = sheet("blind", 0.76, 0.74, 0.68);
pub const PORCELAIN: Paint = solid("porcelain", 0.78, 0.77, 0.74);
pub const GLAZE: Paint = solid("blue glaze", 0.10, 0.22, 0.45);
pub const COFFEE: Paint = solid("coffee", 0.06, 0.03, 0.015);
pub const GRAPHITE: Paint = solid("graphite", 0.08, 0.08, 0.085);
pub const BARE_WOOD: Paint = solid("bare wood", 0.66, 0.48, 0.30);
pub const ERASER: Paint = solid("eraser", 0.72, 0.34, 0.33);
pub const PENCILS: [Paint; 4] = [
    solid("yellow pencil", 0.76, 0.52, 0.07),
    solid("red pencil", 0.58, 0.07, 0.06),
    solid("green pencil", 0.07, 0.30, 0.15),
    solid("blue pencil", 0.07, 0.17, 0.48),
];
pub const TACKS: [Paint; 5] = [
    solid("red tack", 0.62, 0.05, 0.05),
    solid("blue tack", 0.06, 0.14, 0.55),
    solid("yellow tack", 0.78, 0.62, 0.06),
    solid("green tack", 0.05, 0.38, 0.12),
    solid("white tack", 0.78, 0.78, 0.76),
];
pub const COVERS: [Paint; 14] = [
    solid("cover maroon", 0.26, 0.06, 0.06),
    solid("cover brick", 0.44, 0.15, 0.09),
    solid("cover rust", 0.52, 0.27, 0.10),
    solid("cover ochre", 0.60, 0.45, 0.15),
    solid("cover olive", 0.27, 0.28, 0.10),
    solid("cover forest", 0.07, 0.19, 0.10),
    solid("cover teal", 0.09, 0.29, 0.30),
    solid("cover navy", 0.06, 0.09, 0.24),
    solid("cover slate", 0.23, 0.28, 0.36),
    solid("cover plum", 0.22, 0.09, 0.22),
    solid("cover grey", 0.42, 0.42, 0.41),
    solid("cover cream", 0.72, 0.66, 0.52),
    solid("cover black", 0.05, 0.05, 0.055),
    solid("cover sky", 0.40, 0.53, 0.64),
];
pub const PICTURE_SKY: Paint = solid("print sky", 0.50, 0.61, 0.70);
pub const PICTURE_HILL: Paint = solid("print hill", 0.30, 0.36, 0.19);
pub const PICTURE_FIELD: Paint = solid("print field", 0.62, 0.52, 0.24);
pub const MOUNT: Paint = solid("picture mount", 0.78, 0.76, 0.70);
