//! The methods, one file each; `build.rs` lists the folder.
#![allow(missing_docs, reason = "each file documents its method in the record")]

use super::method::Record;
use crate::error::Error;

include!(concat!(env!("OUT_DIR"), "/steppers.rs"));

/// The record of the method of that name.
pub fn method(name: &str) -> Result<&'static Record, Error> {
    let known = || RECORDS.iter().map(|record| record.name).collect::<Vec<_>>().join(", ");
    let record = RECORDS.iter().copied().find(|record| record.name == name);
    record.ok_or_else(|| Error::UnknownMethod { name: name.to_owned(), known: known() })
}
