//! embree4-sys
