//! The systems, one file each; `build.rs` lists the folder.

use super::{spec::Signature, system::Kind};
use crate::error::Error;

include!(concat!(env!("OUT_DIR"), "/systems.rs"));

/// The kind of system that a signature names.
pub fn kind(signature: &Signature) -> Result<&'static Kind, Error> {
    let known = || KINDS.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", ");
    let kind = KINDS.iter().copied().find(|kind| kind.name == signature.system);
    kind.ok_or_else(|| Error::UnknownSystem { name: signature.system.clone(), known: known() })
}
