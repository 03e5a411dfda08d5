//! The whole robot as rigid bodies: a trunk and the links of its legs.
//!
//! The robot's file has the mass and the inertia of all of it at the nominal stance, and those of the links. What is left is the trunk:
//!
//! ```text
//!   m₀ = m − Σ mₗ,   m₀ c₀ = −Σ mₗ cₗ,   I₀ = I − Σ (Rₗ Iₗ Rₗᵀ + mₗ S(cₗ)) − m₀ S(c₀),   S(c) = |c|² 1 − c cᵀ
//! ```
//!
//! with cₗ, Rₗ the links' places and orientations at the nominal stance, base frame, origin at the center of mass of that stance. In another
//! posture the center of mass is at s = Σ mₗ cₗ / m, the *shift*.

use nalgebra::{Matrix3, Vector3};

use super::Leg;
use super::chain::{ByJoint, Chain, Placed};

/// A rigid body that is part of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// kg.
    pub mass: f64,
    /// Its center of mass from its own joint; for the trunk from the origin of the base frame, m.
    pub center: Vector3<f64>,
    /// About that center, kg m².
    pub inertia: Matrix3<f64>,
}

/// A robot whose links are known.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Total mass, kg.
    pub mass: f64,
    /// m.
    pub trunk: Link,
    /// By foot.
    pub legs: Vec<Leg>,
}

/// Where the links are: base frame, origin at the center of mass of the nominal stance.
#[derive(Clone, Debug)]
pub struct Posture {
    /// s: the center of mass, m.
    pub shift: Vector3<f64>,
    /// The centers of mass, first the trunk's, then leg by leg, m.
    pub centers: Vec<Vector3<f64>>,
    /// The orientations, likewise.
    pub rotations: Vec<Matrix3<f64>>,
    /// The joints of each leg.
    pub joints: Vec<Placed<f64>>,
    /// Their angles, from the base down, rad.
    pub angles: Vec<ByJoint<f64>>,
}

/// S(c) = |c|² 1 − c cᵀ.
fn spread(c: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::identity() * c.norm_squared() - c * c.transpose()
}

fn matrix(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| rows[i][j])
}

impl Body {
    /// A robot of a given mass and inertia, whose legs stand at `nominal`; none if a leg has no chain of joints. The error says what no
    /// trunk can have.
    pub fn new(
        mass: f64,
        inertia: Matrix3<f64>,
        legs: &[Option<Leg>],
        nominal: &[Vector3<f64>],
    ) -> Option<Result<Self, String>> {
        let legs = legs.iter().cloned().collect::<Option<Vec<Leg>>>()?;
        if legs.is_empty() || legs.iter().any(|leg| leg.chain.is_none()) {
            return None;
        }
        let trunk = Link { mass: 0.0, center: Vector3::zeros(), inertia: Matrix3::zeros() };
        let mut body = Self { mass, trunk, legs };
        let feet: Vec<Vector3<f64>> =
            nominal.iter().zip(&body.legs).map(|(n, leg)| n + Vector3::z() * leg.foot_radius).collect();
        let posture = body.posture(&feet);
        let links: Vec<Link> = body.links().skip(1).collect();
        let of_links: f64 = links.iter().map(|link| link.mass).sum();
        let trunk_mass = mass - of_links;
        if trunk_mass <= 0.0 {
            return Some(Err(format!(
                "the links of its legs weigh {of_links:.3} kg, all of it {mass:.3} kg"
            )));
        }
        let moment: Vector3<f64> =
            links.iter().zip(&posture.centers[1..]).map(|(link, c)| c * link.mass).sum();
        let center = -moment / trunk_mass;
        let mut rest = inertia - spread(&center) * trunk_mass;
        for ((link, c), r) in links.iter().zip(&posture.centers[1..]).zip(&posture.rotations[1..]) {
            rest -= r * link.inertia * r.transpose() + spread(c) * link.mass;
        }
        if rest.symmetric_eigenvalues().min() <= 0.0 {
            let moments = rest.symmetric_eigenvalues();
            return Some(Err(format!(
                "without the links of its legs, its trunk has the principal moments {:.4?} kg m², which must be positive",
                moments.as_slice()
            )));
        }
        body.trunk = Link { mass: trunk_mass, center, inertia: rest };
        Some(Ok(body))
    }

    /// The number of the first link of a leg.
    pub fn first_link(&self, leg: usize) -> usize {
        1 + self.legs[..leg].iter().map(Leg::joints).sum::<usize>()
    }

    /// The trunk, then the links leg by leg.
    pub fn links(&self) -> impl Iterator<Item = Link> {
        let of_legs = self.legs.iter().filter_map(|leg| leg.chain.as_ref()).flat_map(|chain| {
            chain.joints.iter().map(|j| Link { mass: j.mass, center: j.center, inertia: j.inertia })
        });
        std::iter::once(self.trunk).chain(of_legs)
    }

    /// Calls with the joints of each leg, their angles and where they are, the centers of the feet at given places, base frame from the center of mass of the nominal
    /// stance, m.
    fn for_each_leg(&self, feet: &[Vector3<f64>], mut visit: impl FnMut(&Chain, ByJoint<f64>, Placed<f64>)) {
        for (leg, foot) in self.legs.iter().zip(feet) {
            let Some(chain) = &leg.chain else { continue };
            let contact = foot - Vector3::z() * leg.foot_radius;
            let angles = leg.posture::<f64>(contact.into()).joint_angles();
            let placed = chain.place::<f64>(&angles);
            visit(chain, angles, placed);
        }
    }

    /// [`Posture::shift`] alone, of [`Body::posture`].
    fn shift(&self, feet: &[Vector3<f64>]) -> Vector3<f64> {
        let mut moment = self.trunk.center * self.trunk.mass;
        self.for_each_leg(feet, |chain, _, placed| {
            for (j, joint) in chain.joints.iter().enumerate() {
                moment += Vector3::from(placed.point(j, &joint.center)) * joint.mass;
            }
        });
        moment / self.mass
    }

    /// The posture with the centers of the feet at given places, base frame from the center of mass of the nominal stance, m.
    pub fn posture(&self, feet: &[Vector3<f64>]) -> Posture {
        let links = self.first_link(self.legs.len());
        let mut posture = Posture {
            shift: self.trunk.center * self.trunk.mass,
            centers: Vec::with_capacity(links),
            rotations: Vec::with_capacity(links),
            joints: Vec::with_capacity(self.legs.len()),
            angles: Vec::with_capacity(self.legs.len()),
        };
        posture.centers.push(self.trunk.center);
        posture.rotations.push(Matrix3::identity());
        self.for_each_leg(feet, |chain, angles, placed| {
            for (j, joint) in chain.joints.iter().enumerate() {
                let center = Vector3::from(placed.point(j, &joint.center));
                posture.shift += center * joint.mass;
                posture.centers.push(center);
                posture.rotations.push(matrix(&placed.rotation[j]));
            }
            posture.joints.push(placed);
            posture.angles.push(angles);
        });
        posture.shift /= self.mass;
        posture
    }

    /// The posture with the centers of the feet at given places, base frame from the center of mass *as it is in that posture*, m. It is
    /// found by fixed-point iteration from the guess `shift`.
    pub fn posture_about_center(&self, feet: &[Vector3<f64>], shift: Vector3<f64>) -> Posture {
        let mut moved = feet.to_vec();
        let mut about = |shift: Vector3<f64>| {
            moved.iter_mut().zip(feet).for_each(|(moved, foot)| *moved = foot + shift);
            self.shift(&moved)
        };
        let (mut tried, mut found) = (shift, about(shift));
        // The last change and where it led to, for Anderson's extrapolation over one step.
        let mut last = None::<(Vector3<f64>, Vector3<f64>)>;
        for _ in 0..SHIFT_ROUNDS {
            let change = found - tried;
            if change.norm() < SHIFT_TOLERANCE {
                break;
            }
            let mut next = found;
            if let Some((change_before, found_before)) = last {
                let difference = change - change_before;
                let part = change.dot(&difference) / difference.norm_squared().max(f64::MIN_POSITIVE);
                next -= (found - found_before) * part.clamp(-0.5, 0.5);
            }
            last = Some((change, found));
            tried = next;
            found = about(tried);
        }
        moved.iter_mut().zip(feet).for_each(|(moved, foot)| *moved = foot + found);
        self.posture(&moved)
    }

    /// The angular momentum about the center of mass between two postures, world frame, kg m²/s: R is the orientation of the base and
    /// `step` the time from one to the other, s. It is that of the middle, to second order in `step`.
    pub fn angular_momentum(
        &self,
        [before, after]: [(&Posture, &Matrix3<f64>); 2],
        step: f64,
    ) -> Vector3<f64> {
        let from_center =
            |(posture, r): (&Posture, &Matrix3<f64>), l: usize| r * (posture.centers[l] - posture.shift);
        self.links()
            .enumerate()
            .map(|(l, link)| {
                let [a, b] = [from_center(before, l), from_center(after, l)];
                let turns = [before.1 * before.0.rotations[l], after.1 * after.0.rotations[l]];
                (a + b).cross(&(b - a)) * (0.5 * link.mass / step) + spin(&turns, &link.inertia, step)
            })
            .sum()
    }
}

/// The angular momentum of a body that turns from one orientation to another in `step` s.
pub fn spin(turns: &[Matrix3<f64>; 2], inertia: &Matrix3<f64>, step: f64) -> Vector3<f64> {
    let turn = small_turn(&(turns[1] * turns[0].transpose()));
    turns.iter().map(|r| r * (inertia * r.tr_mul(&turn))).sum::<Vector3<f64>>() * (0.5 / step)
}

/// The rotation vector of a rotation by less than half a turn, exact for small ones.
fn small_turn(r: &Matrix3<f64>) -> Vector3<f64> {
    let skew = Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]) * 0.5;
    let sin = skew.norm();
    if sin == 0.0 { skew } else { skew * (sin.atan2(0.5 * (r.trace() - 1.0)) / sin) }
}

/// Each round without extrapolation leaves about an eighth of the error.
const SHIFT_ROUNDS: usize = 12;
/// m, before the last round. Momenta are differences of postures that are as little as 1e-5 m apart.
const SHIFT_TOLERANCE: f64 = 8e-9;
