//! Both render passes.
