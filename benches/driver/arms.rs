//! Serial arms of any number of joints, for the growth of costs with it.

use elastocal::plan::Plan;
use elastocal::plan::search::random_plan;
use elastocal::scenario::Scenario;

/// An arm of n hinges whose axes point along z, y, y, x, y, x, and so on again, with links of 0.3 m;
/// lives as long as the program.
pub fn serial_arm(joints: u32) -> &'static Scenario {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("arm.xml"), model(joints)).expect("written");
    let path = folder.path().join("arm.toml");
    std::fs::write(&path, scenario(joints)).expect("written");
    Box::leak(Box::new(Scenario::load(&path).expect("a valid scenario")))
}

/// Six random measurements of such an arm.
pub fn plan(joints: u32) -> Plan {
    let arm = serial_arm(joints);
    random_plan(&arm.task, 6, arm.seed, 0).expect("feasible")
}

fn model(joints: u32) -> String {
    let axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"];
    let (mut bodies, mut ends, mut actuators) = (String::new(), String::new(), String::new());
    for (number, axis) in (1..=joints).zip(axes.into_iter().cycle()) {
        bodies += &format!(
            "<body pos=\"0 0 0.3\"><inertial pos=\"0 0 0.15\" mass=\"5\" diaginertia=\"0.1 0.1 0.1\"/>\
             <joint name=\"joint_{number}\" axis=\"{axis}\" range=\"-2 2\"/>"
        );
        ends += "</body>";
        actuators += &format!("<position joint=\"joint_{number}\" kp=\"300000\"/>");
    }
    format!(
        "<mujoco><compiler angle=\"radian\"/><default><joint limited=\"false\"/></default>\
         <worldbody>{bodies}<site name=\"tool\" pos=\"0.2 0.1 0.3\"/>{ends}</worldbody>\
         <actuator>{actuators}</actuator></mujoco>"
    )
}

fn scenario(joints: u32) -> String {
    let names: Vec<String> = (1..=joints).map(|n| format!("\"joint_{n}\"")).collect();
    let angles: Vec<String> = (1..=joints).map(|n| format!("{}", 8 * n)).collect();
    format!(
        "[robot]\nmodel = \"arm.xml\"\ncalibration_site = \"tool\"\nmachining_site = \"tool\"\n\
         parameters = [{}]\n[instrument]\nsigma_mm = 0.03\nsigma_of = \"deflection\"\n\
         [[test_pose]]\nq_deg = [{}]\nforce_n = [100, 200, -150]\n\
         [load]\nkind = \"any\"\nforce_max_n = 400\n[region]\n[design]\nexperiments = 6\n",
        names.join(", "),
        angles.join(", ")
    )
}
