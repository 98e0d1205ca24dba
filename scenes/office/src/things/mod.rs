//! The things in the office, one module each.

use crate::office::Office;

mod ball;
mod blinds;
mod books;
mod cabinet;
mod calculator;
mod chair;
mod clock;
mod computer;
mod corkboard;
mod desk;
mod keyboard;
mod lights;
mod pictures;
mod plant;
mod radiator;
mod radio;
mod room;
mod rug;
mod shelves;
mod stationery;
mod table;
mod telephone;

/// Puts everything in its place.
pub fn furnish(office: &mut Office) {
    room::add(office);
    lights::add(office);
    blinds::add(office);
    radiator::add(office);
    desk::add(office);
    chair::add(office);
    shelves::add(office);
    cabinet::add(office);
    table::add(office);
    corkboard::add(office);
    pictures::add(office);
    clock::add(office);
    rug::add(office);
    ball::add_bin(office);
}
