//! Conditions of a motion: what contradicts itself is refused, a payload makes another robot, and what no motion can do is explained.

use crate::common::solved;
use warpgait::check::check;
use warpgait::robot::{Robot, RobotSpec};
use warpgait::scenario::load_text;

const FLAT: &str = "horizon = 5.0\n[robot]\nname = \"anymal_c\"\n[terrain]\nkind = \"flat\"\nextent = [-2.0, 2.0, -2.0, 2.0]\n\
    [start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.5, 0.0]\n";

fn refusal(conditions: &str) -> String {
    load_text("s.toml", &format!("{FLAT}{conditions}"), ".".as_ref(), &[]).expect_err(conditions).to_string()
}

#[test]
fn contradictions_are_refused_with_both_lines() {
    let foothold = "[[foothold]]\nfoot = \"LF\"\nstep = 1\nposition = [0.5, 0.3]\n";
    let kept = "[[keep_out]]\npolygon = [[0.4, 0.2], [0.6, 0.2], [0.6, 0.4], [0.4, 0.4]]\n";
    for (conditions, expected) in [
        (
            format!("{foothold}{kept}"),
            "s.toml:14: foothold[0].position: given [0.5, 0.3], which is kept free of feet (keep_out[0].polygon, line 16)",
        ),
        (
            format!("{foothold}{foothold}"),
            "s.toml:17: foothold[1].step: given 1 for LF, which already has a place (foothold[0].step, line 13)",
        ),
        (
            foothold.replace("LF", "FL"),
            "s.toml:12: foothold[0].foot: given \"FL\"; allowed: the feet of anymal_c: LF, RF, LH, RH",
        ),
        (
            foothold.replace("step = 1", "time = 9.0"),
            "s.toml:13: foothold[0].time: given 9 s, allowed: at most the horizon of 5 s (horizon, line 1)",
        ),
        (
            foothold.replace("step = 1\n", ""),
            "s.toml:11: foothold[0].step: give the number of a step or a time, and not both",
        ),
        (
            foothold.replace("0.3]", "3.0]"),
            "s.toml:14: foothold[0].position: given [0.5, 3], outside the terrain (terrain.extent, line 6)",
        ),
        (
            "[posture]\nroll = [0.2, -0.2]\n".into(),
            "s.toml:12: posture.roll: given [0.2, -0.2], allowed: [least, greatest], the first smaller",
        ),
        (
            "[posture]\nheight = [0.9, 1.0]\n".into(),
            "s.toml:12: posture.height: given [0.9, 1] m, which excludes every stance of anymal_c: its legs carry",
        ),
        (
            "[[force]]\nvector = [1.0, 0.0, 0.0]\nfrom = 2.0\nuntil = 1.0\n".into(),
            "s.toml:14: force[0].until: given 1 s, allowed: after 2 s (force[0].from, line 13)",
        ),
        (
            "[[keep_out]]\npolygon = [[-1.0, -1.0], [0.2, -1.0], [0.2, 1.0], [-1.0, 1.0]]\n".into(),
            "s.toml:8: start.position: given [0, 0], where foot LH finds no place to stand: all that it reaches is kept free of feet (keep_out[0].polygon, line 12)",
        ),
        (
            "[start.state]\nfeet = [[0.3, 0.2, 0.0], [0.3, -0.2, 0.0], [-0.3, 0.2, 0.0], [-0.3, -0.2, 0.0]]\n\
             [[keep_out]]\npolygon = [[-0.4, 0.1], [-0.2, 0.1], [-0.2, 0.3]]\n".into(),
            "s.toml:12: start.state.feet[2]: given [-0.3, 0.2], which is kept free of feet (keep_out[0].polygon, line 14)",
        ),
        (
            "[[goal.waypoints]]\nposition = [0.0, 1.5]\n[[keep_out]]\npolygon = [[-1.9, 0.7], [1.9, 0.7], [1.9, 3.0], [-1.9, 3.0]]\n".into(),
            "s.toml:12: goal.waypoints[0].position: given [0, 1.5], where foot LF finds no place to stand: all that it reaches is kept free of feet (keep_out[0].polygon, line 14)",
        ),
        ("[[keep_out]]\n".into(), "s.toml:11: keep_out[0]: gives neither a polygon nor a mask"),
        (
            "[[keep_out]]\nmask = \"absent.png\"\npolygon = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]\n".into(),
            "s.toml:13: keep_out[0].polygon: given together with a mask (keep_out[0].mask, line 12); remove one",
        ),
        ("[[keep_out]]\nmask = \"absent.png\"\n".into(), "s.toml:12: keep_out[0].mask: "),
        (
            "[[gait.sequence]]\nkind = \"walk\"\nduration = 3.0\n".into(),
            "s.toml:11: gait.sequence: the durations sum to 3 s, but the horizon is 5 s (horizon, line 1)",
        ),
        (
            "[[gait.sequence]]\nkind = \"stand\"\nduty = 0.6\n".into(),
            "s.toml:13: gait.sequence[0].duty: given for \"stand\" (gait.sequence[0].kind, line 12), which has no steps",
        ),
        (
            "[gait]\nkind = \"custom\"\nphases = [[4.0], [5.0], [5.0], [5.0]]\n".into(),
            "s.toml:13: gait.phases[0]: the durations sum to 4 s, expected the horizon, 5 s (horizon, line 1)",
        ),
        (
            "[[keep_out]]\npolygon = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]\n".into(),
            "s.toml:12: keep_out[0].polygon: its corners are on a line",
        ),
    ] {
        let message = refusal(&conditions);
        assert!(message.starts_with(expected), "{message}\nis not\n{expected}");
    }
    let higher = FLAT.replace("[goal]", "[posture]\nheight = [0.4, 0.5]\n[goal]\nheight = 0.55");
    let message = load_text("s.toml", &higher, ".".as_ref(), &[]).unwrap_err().to_string();
    let expected = "s.toml:12: goal.height: given 0.55 m, outside [0.4, 0.5] (posture.height, line 10)";
    assert!(message.starts_with(expected), "{message}");
}

#[test]
fn a_payload_moves_the_center_of_mass_and_keeps_the_size() {
    let spec = RobotSpec { name: "anymal_c".into(), ..Default::default() };
    let bare = Robot::load(&spec, ".".as_ref()).unwrap();
    let loaded = bare.clone().with_payload(10.0, [0.2, 0.0, 0.3]).unwrap();
    let moved = 10.0 / (bare.mass + 10.0);
    assert!((loaded.mass - bare.mass - 10.0).abs() < 1e-12);
    assert!((bare.feet[0].nominal[0] - loaded.feet[0].nominal[0] - 0.2 * moved).abs() < 1e-12);
    assert!((loaded.standing_height() - bare.standing_height() - 0.3 * moved).abs() < 1e-9);
    assert_eq!(loaded.size(), bare.size());
    // The parallel axis theorem for two bodies: the reduced mass times the square of their distance.
    let reduced = bare.mass * moved;
    assert!((loaded.inertia[1][1] - bare.inertia[1][1] - reduced * (0.04 + 0.09)).abs() < 1e-9);
    // The trunk carries it.
    let trunk = |robot: &Robot| robot.body().expect("links").trunk.mass;
    assert!((trunk(&loaded) - trunk(&bare) - 10.0).abs() < 1e-9);
}

#[test]
fn what_no_motion_can_do_is_explained_and_stays_unsolved() {
    let text = |explain: bool| {
        format!(
            "formulation = \"direct\"\nhorizon = 3.0\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"flat\"\nextent = [-2.0, 2.0, -2.0, 2.0]\n\
             [start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.2, 0.0]\n[motion]\nbase_clearance = 0.4\n[contact]\nfriction_margin = 0.0\n\
             [solver]\nmax_iterations = 60\nexplain = {explain}\n"
        )
    };
    let (motion, plan) = solved(&text(true));
    assert!(!motion.solved && !check(&plan).unwrap().passed);
    let why = plan.meta.explanation.as_ref().expect("an explanation");
    assert!(why.shortfalls.iter().any(|s| s.block == "base clearance" && s.amount > 70.0), "{why:?}");
    assert!(
        why.shortfalls.iter().all(|s| s.words.contains(&s.unit) && (0.0..=3.0).contains(&s.time[0])),
        "{why:?}"
    );
    assert!(!why.shortfalls.iter().any(|s| s.block == "dynamics"));
    let [key, to, from] = why.remedy.as_ref().expect("a remedy");
    assert_eq!((key.as_str(), from.as_str()), ("motion.base_clearance", "0.4"));
    let less = text(false).replace("base_clearance = 0.4", &format!("base_clearance = {to}"));
    assert!(solved(&less).0.solved, "{to}");
    let (motion, plan) = solved(&text(false));
    assert!(!motion.solved && plan.meta.explanation.is_none());
}

/// A NumPy array of bytes.
fn npy(dtype: &str, rows: u64, columns: u64, elements: &[u8]) -> Vec<u8> {
    let header = warpgait::files::npy::Header {
        dtype: dtype.into(),
        fortran_order: false,
        shape: vec![rows, columns],
    };
    [header.write().expect("a header"), elements.to_vec()].concat()
}

#[test]
fn a_mask_keeps_feet_off_and_the_plan_has_its_outlines() {
    let folder = tempfile::tempdir().expect("a folder");
    // Cells of 10 cm; a stripe of 20 cm on the left side of the way, and one cell far away.
    let mut cells = vec![0_u8; 40 * 40];
    for row in 16..18 {
        cells[row * 40..][20..30].fill(1);
    }
    cells[0] = 1;
    std::fs::write(folder.path().join("mask.npy"), npy("|b1", 40, 40, &cells)).expect("a file");
    let text = "formulation = \"direct\"\nhorizon = 4.0\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"flat\"\nextent = [-2.0, 2.0, -2.0, 2.0]\n\
                [start]\nposition = [-0.5, 0.0]\n[goal]\nposition = [0.3, 0.0]\n[[keep_out]]\nmask = \"mask.npy\"\n";
    let (motion, mut plan) = crate::common::solved_in(folder.path(), text);
    assert!(motion.solved, "{}", motion.status);
    let row = |plan: &warpgait::plan::Plan| {
        let report = check(plan).expect("a sound plan");
        report.rows.iter().find(|row| row.name == "keep_out").map(|row| row.passed)
    };
    assert_eq!(row(&plan), Some(true));
    assert!(plan.meta.inputs.iter().any(|(name, _)| name == "mask.npy"));
    let scenario = warpgait::scenario::parse("s.toml", &plan.meta.scenario).expect("a scenario");
    let kept = &scenario.keep_out[0];
    assert!(kept.mask.is_none() && kept.outlines.len() == 2);
    // Row 16 is from 0.3 to 0.4 m.
    for (place, distance) in
        [([0.5, 0.3], -0.1), ([0.5, 0.5], 0.1), ([0.5, 0.0], 0.2), ([-1.95, 1.95], -0.05)]
    {
        assert!((kept.distance(place) - distance).abs() < 1e-9, "{place:?}: {}", kept.distance(place));
    }
    // In the middle of the stripe a foot is too deep.
    let stands = plan.foot_contact.iter().position(|stands| *stands).expect("a stance");
    plan.foot_position[stands] = [0.5, 0.3, 0.0];
    assert_eq!(row(&plan), Some(false));

    for (content, words) in [
        (b"GIF89a".to_vec(), "is neither a PNG image nor a NumPy array"),
        (npy("|b1", 40, 40, &cells[1..]), "has 1599 bytes of elements, not those of its shape"),
        (npy("|b1", 1, 4, &[0; 4]), "keeps nothing free"),
        (npy("<U1", 1, 1, &[0; 4]), "has elements of type <U1; allowed: booleans and numbers"),
        (npy("|b1", 0, 4, &[]), "4 x 0 cells; allowed: 1 to"),
        (npy("<f4", 1, 1, &f32::NAN.to_le_bytes()), "has 1 elements that are NaN"),
        (b"\x89PNG\r\n\x1a\n".to_vec(), "not a valid PNG image"),
    ] {
        std::fs::write(folder.path().join("mask.npy"), content).expect("a file");
        let message = load_text("s.toml", text, folder.path(), &[]).expect_err(words).to_string();
        assert!(message.starts_with("s.toml:13: keep_out[0].mask: ") && message.contains(words), "{message}");
    }
}

#[test]
fn more_time_is_a_remedy_for_haste_and_was_tried() {
    let text = |horizon: &str| {
        format!(
            "formulation = \"direct\"\nhorizon = {horizon}\n[robot]\nname = \"anymal_towr\"\n[terrain]\nkind = \"flat\"\nextent = [-2.0, 2.0, -2.0, 2.0]\n\
             [start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.8, 0.0]\n[gait]\nkind = \"trot\"\n[contact]\nfriction_margin = 0.0\n\
             [solver]\nmax_iterations = 60\n"
        )
    };
    let (motion, plan) = solved(&text("2.0"));
    assert!(!motion.solved);
    let why = plan.meta.explanation.as_ref().expect("an explanation");
    let [key, to, from] = why.remedy.as_ref().expect("a remedy");
    assert_eq!((key.as_str(), from.as_str()), ("horizon", "2"));
    assert!(solved(&text(to)).0.solved, "{to}");
}
