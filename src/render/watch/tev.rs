//! Shows a rendering in tev, the image viewer, through its network protocol.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use glam::Vec3;
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

use super::{Moment, Rhythm, Watcher};
use crate::render::film::Pixel;
use crate::render::session::Session;

/// Time between two updates.
const EVERY: Duration = Duration::from_secs(1);

/// Updates take no more than one part in so many of the time.
const PAUSE: u32 = 20;

/// Rows that are sent together, where one of them has changed.
const ROWS: usize = 8;

/// tev answers, or takes what it is sent, within this, or it is not there.
const PATIENCE: Duration = Duration::from_secs(3);

const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Sends the picture so far to tev.
pub struct TevViewer {
    client: Option<TevClient>,
    /// How tev calls the image.
    name: String,
    /// What tev shows, row by row; empty before the first time.
    shown: Vec<Vec3>,
    rhythm: Rhythm,
}

impl TevViewer {
    /// Connects to the tev that listens at `address` (`host:port`), to show an image under this name.
    ///
    /// # Errors
    /// When none does.
    pub fn connect(address: &str, name: &str) -> io::Result<Self> {
        let mut outcome = Err(io::Error::new(io::ErrorKind::NotFound, "the host has no address"));
        for address in address.to_socket_addrs()? {
            outcome = TcpStream::connect_timeout(&address, PATIENCE);
            if outcome.is_ok() {
                break;
            }
        }
        let socket = outcome?;
        socket.set_write_timeout(Some(PATIENCE))?;
        // A zero byte ends a name in the protocol.
        let name = name.replace('\0', "");
        Ok(TevViewer {
            client: Some(TevClient::wrap(socket)),
            name,
            shown: Vec::new(),
            rhythm: Rhythm::new(EVERY, PAUSE),
        })
    }
}

/// Sends the rows of a picture that are not shown yet.
fn update(client: &mut TevClient, name: &str, size: [u32; 2], picture: &[Vec3], shown: &[Vec3]) -> io::Result<()> {
    let [width, height] = size;
    if shown.is_empty() {
        let image = PacketCreateImage { image_name: name, grab_focus: true, width, height, channel_names: &CHANNELS };
        client.send(image)?;
    }
    let band = ROWS * width as usize;
    for (number, rows) in picture.chunks(band).enumerate() {
        if shown.get(number * band..number * band + rows.len()) == Some(rows) {
            continue;
        }
        client.send(PacketUpdateImage {
            image_name: name,
            grab_focus: false,
            channel_names: &CHANNELS,
            channel_offsets: &[0, 1, 2],
            channel_strides: &[3; 3],
            x: 0,
            y: (number * ROWS) as u32,
            width,
            height: (rows.len() / width as usize) as u32,
            data: bytemuck::cast_slice(rows),
        })?;
    }
    Ok(())
}

impl Watcher for TevViewer {
    fn wait(&self) -> Duration {
        if self.client.is_some() { self.rhythm.wait() } else { Duration::MAX }
    }

    fn look(&mut self, session: &Session, _: Moment) {
        let Some(client) = &mut self.client else { return };
        let (name, shown) = (&self.name, &mut self.shown);
        let sent = self.rhythm.beat(|| {
            let picture: Vec<Vec3> = session.film().pixels().map(Pixel::radiance).collect();
            update(client, name, session.region().size(), &picture, shown)?;
            *shown = picture;
            Ok::<_, io::Error>(())
        });
        if let Err(error) = sent {
            log::warn!("tev does not show the image any more: {error}");
            self.client = None;
        }
    }
}
