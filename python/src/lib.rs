//! elastocal for Python: the program's commands, and the planning problem's matrices.
//!
//! Commands are those of the command line, of the same library: the same code, the same records, the same messages.
//! What they come to passes as JSON; the package `elastocal` around this module makes arrays of it.

mod commands;
mod problem;
mod tables;

use pyo3::prelude::*;

/// The module `elastocal._elastocal`.
#[pymodule]
fn _elastocal(module: &Bound<'_, PyModule>) -> PyResult<()> {
    elastocal::mujoco::print_warnings(false);
    module.add("VERSION", elastocal::VERSION)?;
    module.add("COMMIT", elastocal::COMMIT)?;
    module.add_function(wrap_pyfunction!(commands::main, module)?)?;
    module.add_function(wrap_pyfunction!(commands::set_shared, module)?)?;
    module.add_function(wrap_pyfunction!(commands::command, module)?)?;
    module.add_function(wrap_pyfunction!(commands::options, module)?)?;
    module.add_function(wrap_pyfunction!(tables::read_toml, module)?)?;
    module.add_function(wrap_pyfunction!(tables::written_toml, module)?)?;
    module.add_class::<problem::PlanningProblem>()
}
