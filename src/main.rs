fn main(){ println!("{}", mujoco_rs::prelude::MjModel::from_xml_string("<mujoco/>").is_ok()); }
