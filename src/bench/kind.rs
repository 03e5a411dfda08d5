//! The benches: tables and figures of the paper, and what goes beyond them.

/// A table or figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bench {
    /// Table I: how many motions are found on four terrains, in both formulations.
    Table1,
    /// Fig. 4: the conformal error of the map on the ground.
    Fig4,
    /// Fig. 5: the map's energy by iteration, with the paper's methods and ours.
    Fig5,
    /// Fig. 8: violation by iteration, for all headings.
    Fig8,
    /// Fig. 9: time to solve, for all headings.
    Fig9,
    /// Fig. 11: violation by iteration, for one climb.
    Fig11,
    /// Success against steepness beyond the hard level, and against coarser knots.
    Frontier,
    /// Maps by method, terrain and level.
    Map,
    /// Cost against the length of the motion.
    Speed,
    /// The plans of Table I, replayed on the full robots.
    Track,
}

impl Bench {
    /// All of them.
    pub const ALL: [Bench; 10] = [
        Bench::Table1,
        Bench::Fig4,
        Bench::Fig5,
        Bench::Fig8,
        Bench::Fig9,
        Bench::Fig11,
        Bench::Frontier,
        Bench::Map,
        Bench::Speed,
        Bench::Track,
    ];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Bench::Table1 => "table1",
            Bench::Fig4 => "fig4",
            Bench::Fig5 => "fig5",
            Bench::Fig8 => "fig8",
            Bench::Fig9 => "fig9",
            Bench::Fig11 => "fig11",
            Bench::Frontier => "frontier",
            Bench::Map => "map",
            Bench::Speed => "speed",
            Bench::Track => "track",
        }
    }
}
