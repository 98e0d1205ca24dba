//! Speed against error of every method of the paper, its tables, and a page that shows them.
pub mod error;
pub mod plan;
pub mod record;
pub mod reference;
pub mod subject;
pub mod work;
