//! Files that robots come in and that are neither MJCF nor URDF: what to do with them.

use std::path::Path;

use super::ModelError;
use crate::text::wording::shell_path;

/// Refuses what is still to be generated, and MJCF that names packages of ROS.
pub(super) fn refuse(path: &Path, text: &str) -> Result<(), ModelError> {
    let foreign = |problem: String, hint: String| {
        Err(ModelError::Foreign {
            path: path.to_owned(),
            problem,
            hint,
        })
    };
    let text = &uncommented(text);
    let is_xacro =
        path.extension().is_some_and(|ending| ending == "xacro") || text.contains("<xacro:");
    if is_xacro {
        let name = path
            .file_stem()
            .unwrap_or("robot".as_ref())
            .to_string_lossy();
        let urdf = format!("{}.urdf", name.trim_end_matches(".urdf"));
        return foreign(
            "is a xacro file: a URDF still to be generated".to_owned(),
            format!(
                "run xacro first: xacro {} > {}",
                shell_path(path),
                shell_path(Path::new(&urdf))
            ),
        );
    }
    let package = text.lines().position(|line| line.contains("package://"));
    let meshes = "replace package://... by the meshes' paths relative to the file";
    if root(text) == Some("robot") {
        return Ok(());
    }
    package.map_or(Ok(()), |line| {
        foreign(
            format!(
                "line {}: names a file by its ROS package (package://), which MuJoCo cannot find",
                line + 1
            ),
            meshes.to_owned(),
        )
    })
}

/// A text with blanks for its comments, in which generators and people leave what no longer counts; lines stay where they are.
fn uncommented(text: &str) -> String {
    let mut found = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find("<!--") {
        let end = rest[start..]
            .find("-->")
            .map_or(rest.len(), |end| start + end + 3);
        found += &rest[..start];
        found.extend(
            rest[start..end]
                .chars()
                .map(|each| if each == '\n' { each } else { ' ' }),
        );
        rest = &rest[end..];
    }
    found + rest
}

/// The name of the outermost element.
fn root(text: &str) -> Option<&str> {
    let mut rest = text;
    loop {
        rest = &rest[rest.find('<')?..];
        let end = if rest.starts_with("<!--") {
            rest.find("-->")?
        } else if rest.starts_with("<?") || rest.starts_with("<!") {
            rest.find('>')?
        } else {
            break;
        };
        rest = &rest[end..];
    }
    rest[1..]
        .split(|c: char| c.is_whitespace() || c == '>' || c == '/')
        .next()
}

#[cfg(test)]
mod tests {
    use super::{root, uncommented};

    #[test]
    fn the_outermost_element_is_found() {
        let behind =
            "<?xml version=\"1.0\"?>\n<!-- <robot> -->\n<!DOCTYPE x>\n<mujoco model='m'><robot/>";
        assert_eq!(root(behind), Some("mujoco"));
        assert_eq!(root("<robot/>"), Some("robot"));
        assert_eq!(root("no element <!-- <robot> "), None);
    }
    #[test]
    fn comments_are_blanks() {
        let text = "<a>\n<!-- x\ny --><b/><!--";
        assert_eq!(uncommented(text), "<a>\n      \n     <b/>    ");
    }
}
