//! oiio-sys
