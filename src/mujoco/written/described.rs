//! A URDF as MJCF.

use std::path::Path;

use mujoco_rs::error::MjEditError;

use crate::mujoco::ModelError;
use crate::mujoco::error::refused;
use crate::mujoco::urdf::UrdfText;

/// So many digits give a number back.
const DIGITS: i32 = 17;

/// A URDF as MuJoCo's compiler understood it, in MJCF.
pub(super) fn as_mjcf(path: &Path, urdf: &UrdfText) -> Result<String, ModelError> {
    let wrong = |error: MjEditError| refused(path, error.to_string());
    let (mut spec, _) = urdf.spec(path)?;
    spec.compile().map_err(wrong)?;
    // Places in full, names and numbers of everything: masses are those of the description.
    spec.compiler_mut().set_saveinertial(true);
    with_digits(DIGITS, || {
        let mut room = 1 << 16;
        loop {
            match spec.save_xml_string(room) {
                Err(MjEditError::XmlBufferTooSmall { required_size }) if required_size >= room => {
                    room = required_size + 1;
                }
                other => return other.map_err(wrong),
            }
        }
    })
}

/// Has MuJoCo write numbers with so many digits meanwhile.
fn with_digits<T>(digits: i32, write: impl FnOnce() -> T) -> T {
    use std::sync::{Mutex, PoisonError};
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    #[expect(
        unsafe_code,
        reason = "MuJoCo has no other way to more than six digits"
    )]
    unsafe extern "C" {
        safe fn _mjPRIVATE__get_xml_precision() -> i32;
        safe fn _mjPRIVATE__set_xml_precision(precision: i32);
    }
    let guard = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let before = _mjPRIVATE__get_xml_precision();
    _mjPRIVATE__set_xml_precision(digits);
    let written = write();
    _mjPRIVATE__set_xml_precision(before);
    drop(guard);
    written
}
