//! The whole stage, on known scenes.
