//! Gaits with flight, of any number of feet, and one after the other: solved and checked.

use std::path::Path;

use crate::common::solved_in;
use warpgait::check::check;
use warpgait::plan::Plan;

/// Solved with every check held.
fn plan(folder: &Path, text: &str) -> Plan {
    let (motion, plan) = solved_in(folder, text);
    assert!(motion.solved, "{}; {:?}", motion.status, motion.violations);
    let report = check(&plan).expect("a sound plan");
    let failed: Vec<_> =
        report.rows.iter().filter(|row| !row.passed).map(|row| (&row.name, row.value)).collect();
    assert!(failed.is_empty(), "{failed:?}");
    plan
}

/// The longest time in which no foot is on the ground, s, and by how much the base falls less than freely in it, m/s².
fn flight(plan: &Plan) -> (f64, f64) {
    let feet = plan.foot_names.len();
    let (mut longest, mut since, mut off) = (0.0_f64, None, 0.0_f64);
    for (n, t) in plan.t.iter().enumerate() {
        if plan.foot_contact[n * feet..][..feet].iter().any(|contact| *contact) {
            since = None;
            continue;
        }
        let from = *since.get_or_insert(*t);
        longest = longest.max(t - from);
        off = off.max((plan.base_linear_acceleration[n][2] + 9.81).abs());
    }
    (longest, off)
}

const FLAT: &str = "horizon = 2.5\n[terrain]\nkind = \"flat\"\nspacing = 0.1\n[start]\nposition = [-0.2, 0.0]\n[goal]\nposition = [0.2, 0.0]\n";

#[test]
fn a_robot_in_flight_falls_freely() {
    for (robot, gait, least) in [
        ("anymal_towr", "kind = \"pronk\"", 0.15),
        ("solo12", "kind = \"hop\"", 0.1),
        ("go1", "kind = \"flying-trot\"", 0.02),
        ("anymal_c", "kind = \"bound\"\nduty = 0.4\ncycle = 0.5", 0.02),
    ] {
        for formulation in ["warped", "direct"] {
            let text = format!(
                "formulation = \"{formulation}\"\ntime_step = 0.025\n{FLAT}[robot]\nname = \"{robot}\"\n[gait]\n{gait}\n[physics]\nlegs = \"massless\"\n"
            );
            let (longest, off) = flight(&plan(".".as_ref(), &text));
            assert!(longest > least, "{robot} {gait} {formulation}: {longest} s in the air");
            assert!(off < 0.1, "{robot} {gait} {formulation}: {off} m/s² beside gravity");
        }
    }
}

/// A robot file with feet at these places below the trunk.
fn write_robot(folder: &Path, feet: &[(&str, f64, f64)]) {
    let mut text = String::from(
        "name = \"own\"\nsource = \"a test\"\nmass = 20.0\ninertia = [[1.2, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0, 1.8]]\n\
         torso = { center = [0.0, 0.0, 0.1], half_size = [0.2, 0.1, 0.1] }\n",
    );
    for (name, x, y) in feet {
        text += &format!(
            "[[feet]]\nname = \"{name}\"\nnominal = [{x:?}, {y:?}, -0.5]\nreach = {{ center = [{x:?}, {y:?}, -0.5], half_size = [0.2, 0.12, 0.15] }}\n"
        );
    }
    std::fs::write(folder.join("own.toml"), text).expect("a robot");
}

#[test]
fn one_foot_hops_and_two_six_and_eight_walk_and_trot() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows: [(f64, &str); 4] = [(0.45, "F"), (0.15, "M"), (-0.15, "N"), (-0.45, "H")];
    let pairs = |rows: &[(f64, &str)]| -> Vec<(String, f64, f64)> {
        let pair = |(x, name): &(f64, &str)| [(format!("L{name}"), *x, 0.2), (format!("R{name}"), *x, -0.2)];
        rows.iter().flat_map(pair).collect()
    };
    for (feet, gaits) in [
        (vec![("FOOT".to_owned(), 0.0, 0.0)], vec!["hop"]),
        (pairs(&[(0.0, "")]), vec!["walk", "hop"]),
        (pairs(&[rows[0], (0.0, "M"), rows[3]]), vec!["wave", "tripod"]),
        (pairs(&rows), vec!["walk", "trot"]),
    ] {
        let feet: Vec<(&str, f64, f64)> = feet.iter().map(|(name, x, y)| (name.as_str(), *x, *y)).collect();
        write_robot(folder.path(), &feet);
        for kind in gaits {
            let text = format!("{FLAT}[robot]\nfile = \"own.toml\"\n[gait]\nkind = \"{kind}\"\n");
            let plan = plan(folder.path(), &text.replace("horizon = 2.5", "horizon = 4.0"));
            assert_eq!(plan.foot_names.len(), feet.len());
            assert!(
                plan.phase_durations.iter().all(|phases| phases.len() > 1),
                "{kind}: a foot takes no step"
            );
        }
    }
}

#[test]
fn a_robot_stands_walks_trots_and_stands() {
    let text = "horizon = 7.0\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"rippled\"\nlevel = \"easy\"\nspacing = 0.05\n\
                [start]\nposition = [-0.4, 0.0]\n[goal]\nposition = [0.4, 0.0]\n\
                [[gait.sequence]]\nkind = \"stand\"\nduration = 0.5\n[[gait.sequence]]\nkind = \"walk\"\nduration = 2.9\n\
                [[gait.sequence]]\nkind = \"trot\"\ncycle = 0.8\n[[gait.sequence]]\nkind = \"stand\"\nduration = 0.6\n";
    let plan = plan(".".as_ref(), text);
    let up = |from: f64, to: f64| {
        let inside = |n: &usize| (from..to).contains(&plan.t[*n]);
        let in_the_air =
            |n: usize| plan.foot_contact[4 * n..][..4].iter().filter(|contact| !**contact).count();
        (0..plan.t.len()).filter(inside).map(in_the_air).max().expect("samples")
    };
    assert_eq!([up(0.0, 0.5), up(0.5, 3.4), up(3.4, 6.4), up(6.4, 7.0)], [0, 1, 2, 0]);
}
