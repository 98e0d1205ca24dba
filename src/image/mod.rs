//! Images in and out through OpenImageIO, view transform, error metrics.
