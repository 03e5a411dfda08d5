//! The warp φ: F → A, a tri-cubic B-spline whose bottom face is the terrain (Sections IV-A and IV-B, Eq. 6).

mod assembly;
mod axis;
mod barrier;
mod basis;
mod bottom;
mod bottom_face;
mod build;
mod cache;
mod density;
mod distance;
mod gauss_newton;
mod inverse;
mod jet;
mod lanes;
mod lbfgs;
mod line_search;
mod local_global;
mod objective;
mod preconditioner;
mod problem;
mod refine;
mod report;
mod shear;
mod singular;
mod spline;

pub use build::{MapProgress, build};
pub use cache::{build_cached, default_cache_dir};
pub use jet::WarpJet;
pub use report::{Distribution, EnergyHistory, MapReport, RejectedMap};
pub use spline::{MapGrid, Order, WarpMap};
