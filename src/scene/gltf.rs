//! glTF import.
