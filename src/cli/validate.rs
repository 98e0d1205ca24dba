//! `gsii validate`: Embree against obvhs.
