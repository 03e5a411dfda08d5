//! Ipopt's options, collected with their types and checked by Ipopt itself before a solve, without output.

use super::application::Application;
use super::error::IpoptError;
use super::linear_solver::LinearSolver;
use super::option_value::OptionValue;

/// What [`super::solve`] relies on: no option file, its own value for "no bound", and a linear solver that it has chosen.
const RESERVED: [&str; 5] = [
    "option_file_name",
    "nlp_lower_bound_inf",
    "nlp_upper_bound_inf",
    "linear_solver",
    "linear_system_scaling",
];

/// Options for Ipopt, by the names in its manual. A later setting of an option overrides an earlier one.
///
/// ```
/// use warpgait::ipopt::Options;
/// let options = Options::new().set_int("max_iter", 200).set_num("tol", 1e-4).set_str("mu_strategy", "adaptive");
/// ```
///
/// Where they differ from Ipopt's defaults: silent (`print_level` 0, `sb` yes), `check_derivatives_for_naninf` yes,
/// `hessian_approximation` by whether the problem has a Hessian. All of these can be set; `option_file_name`, `nlp_…_bound_inf`, `linear_system_scaling` and `linear_solver` (see
/// [`Options::linear_solver`]) cannot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    settings: Vec<(String, OptionValue)>,
    pub(super) linear_solver: LinearSolver,
}

impl Options {
    /// Nothing set.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Chooses the linear solver.
    #[must_use]
    pub fn linear_solver(self, linear_solver: LinearSolver) -> Self {
        Self { linear_solver, ..self }
    }

    /// Sets an option that takes an integer.
    #[must_use]
    pub fn set_int(self, name: &str, value: i32) -> Self {
        self.set(name, OptionValue::Int(value))
    }

    /// Sets an option that takes a number.
    #[must_use]
    pub fn set_num(self, name: &str, value: f64) -> Self {
        self.set(name, OptionValue::Num(value))
    }

    /// Sets an option that takes a word.
    #[must_use]
    pub fn set_str(self, name: &str, value: &str) -> Self {
        self.set(name, OptionValue::Str(value.into()))
    }

    fn set(mut self, name: &str, value: OptionValue) -> Self {
        self.settings.retain(|(known, _)| known != name);
        self.settings.push((name.into(), value));
        self
    }

    /// The value of an option, if it was set.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&OptionValue> {
        self.settings.iter().find(|(known, _)| known == name).map(|(_, value)| value)
    }

    /// Passes every setting to Ipopt, which must have been silenced before.
    ///
    /// # Errors
    /// The first setting that Ipopt, or this interface, does not accept.
    pub(super) fn apply(
        &self,
        application: &mut Application,
        linear_solver: LinearSolver,
        has_hessian: bool,
    ) -> Result<(), IpoptError> {
        let wants_exact = self.get("hessian_approximation") == Some(&OptionValue::Str("exact".into()));
        if wants_exact && !has_hessian {
            return Err(IpoptError::NoHessian);
        }
        if let Some((name, _)) = self.settings.iter().find(|(name, _)| RESERVED.contains(&name.as_str())) {
            return Err(IpoptError::OptionReserved(name.clone()));
        }
        let defaults = Self::new()
            .set_str("check_derivatives_for_naninf", "yes")
            .set_str("hessian_approximation", if has_hessian { "exact" } else { "limited-memory" })
            .set_str("linear_system_scaling", "none");
        let defaults = match linear_solver {
            LinearSolver::Faer => with_plug(defaults),
            _ => defaults.set_str("linear_solver", "mumps"),
        };
        for (name, value) in defaults.settings.iter().chain(&self.settings) {
            if !application.set_option(name, value) {
                return Err(IpoptError::OptionRejected { name: name.clone(), value: value.clone() });
            }
        }
        Ok(())
    }
}

/// The options that go with the plugged-in linear solver. Its solutions are refined already, so Ipopt refines only where its own
/// test demands it; and it has no better factorization to offer, which a larger `ma57_pivtol` would request.
fn with_plug(options: Options) -> Options {
    options
        .set_str("linear_solver", "ma57")
        .set_int("min_refinement_steps", 0)
        .set_num("ma57_pivtol", 1e-8)
        .set_num("ma57_pivtolmax", 1e-8)
}
