//! What places learn of the light, by rays of their own.
//!
//! A place learns which emitters it sees: some points of it send rays towards every group of emitters that may light it,
//! and cosine-distributed rays. What it learns depends on the scene alone: neither the seed nor the order of threads has an
//! effect. Every group of emitters keeps a positive share, so estimates stay unbiased.

use glam::{Vec2, Vec3, Vec4};

use super::World;
use super::emitters::receiver::Receiver;
use super::emitters::shares::Shares;
use super::learnt::{Learnt, Link};
use super::surface::SurfacePoint;
use crate::math::color::luminance;
use crate::math::random::{KroneckerSequence, Purpose, Random, unit_from_bits};
use crate::math::sampling::{UNIFORM_SPHERE_DENSITY, cosine_hemisphere, cosine_hemisphere_density, uniform_sphere};
use crate::trace::Ray;

/// Cells are larger than their volume by this share of their side on every side when they look for points: surfaces that
/// lie on a border belong to either cell by rounding.
const OVERLAP: f32 = 0.1;

/// Points that a place learns from, and rays that look for them. A cell may reach into several rooms, and few points miss
/// one: with 8, and places at random, a probe's deviation in a hundred closed rooms was 2.4 × that in one; with an even
/// sequence 1.6 ×, with 16 points 1.4 ×.
const POINTS: usize = 16;
const POINT_RAYS: usize = 48;

/// Of these, how many say how important a group is if nothing occludes it.
const POINTS_OF_IMPORTANCE: usize = 4;

/// Groups that a place sends rays to: those that may send most light.
const TESTED: usize = 32;

/// Rays towards emitters in all, as far as [`RAYS_PER_GROUP`] allows, and cosine-distributed rays. With 64, 2 to 8 and 16
/// (measured when every group had as many),
/// `reference` in office needed 1.3 × (2,048 cells) and 1.5 × (8,192) the time for the same noise; courtyard, bathroom and
/// veach_ajar differed by at most 10 %.
const LIGHT_RAYS: f64 = 96.0;
const RAYS_PER_GROUP: [f64; 2] = [2.0, 16.0];
const COSINE_RAYS: usize = 32;

/// Share of draws that does not follow what was learnt: half of it follows what may arrive if nothing occludes it, half
/// is even over all groups. It bounds the noise where few rays have learnt something wrong, and costs draws: four samples
/// in a room beside others have a noise of 0.11 instead of 0.04.
const DEFENSIVE: f64 = 0.05;

/// Light counts as even if the darkest side has at least this share of the brightest.
const EVEN: f32 = 0.8;

/// The shares of cosine-distributed samples that are tried.
const COSINE_SHARES: [f32; 5] = [0.125, 0.25, 0.5, 0.75, 0.875];

/// Light that a ray found while a place learnt.
struct Found {
    group: usize,
    /// Luminance × cosine.
    light: f32,
    /// Densities of the two techniques, that towards emitters within the group, sr⁻¹.
    in_group: f32,
    by_cosine: f32,
}

impl World<'_> {
    /// What the place of a surface point has learnt.
    #[inline]
    pub fn shares_at(&self, point: &SurfacePoint) -> &Shares {
        &self.learnt(self.places.key_of(point)).shares
    }

    /// What the place of a key has learnt.
    #[inline]
    pub fn learnt(&self, key: usize) -> &Learnt {
        self.places.learnt(key).get_or_init(|| Box::new(self.learn_place(key)))
    }

    fn learn_place(&self, key: usize) -> Learnt {
        let mut random = Random::new(0, Purpose::Places, key as u64, 0);
        let points = self.points_of_place(key, &mut random);
        let receivers: Vec<Receiver> = points.iter().map(|(receiver, _)| *receiver).collect();
        let punctual = points.iter().map(|(_, punctual)| punctual).sum::<f32>() / points.len() as f32;
        let (shares, direct, links) = self.learn(&receivers, |_| true, &mut random);
        Learnt { shares, direct: direct + punctual, links: links.into() }
    }

    /// Points on the surfaces of a place: rays against its main direction find them. Where there are none, points in its
    /// free space. Each with the luminance of what punctual lights send there where they are few, W·m⁻².
    fn points_of_place(&self, key: usize, random: &mut Random) -> Vec<(Receiver, f32)> {
        let few_lamps = !self.scene.lights.is_empty() && !self.emitters.has_lamps();
        let (corner, facing) = self.places.cell(key);
        let margin = self.places.cell * OVERLAP;
        let (low, high) = (corner - margin, corner + self.places.cell + margin);
        let mut points = Vec::new();
        // An even sequence: a corner of another room is not to be missed.
        for bits in KroneckerSequence::new(random).take(POINT_RAYS) {
            let place = Vec4::from(bits.map(unit_from_bits)).truncate();
            let Some(surface) = self.surface(Ray::new(low + (high - low) * place, -facing, random.bits())) else {
                continue;
            };
            let p = surface.position;
            let within = p.cmpge(low).all() && p.cmple(high).all();
            if within && self.places.key(p, surface.geometric_normal) % 6 == key % 6 {
                let normal = surface.shading_normal;
                let punctual =
                    if few_lamps { self.punctual_irradiance(&surface, normal, random.bits()).0 } else { Vec3::ZERO };
                points.push((surface.receiver(normal), luminance(punctual)));
            }
            if points.len() == POINTS {
                break;
            }
        }
        while points.is_empty() {
            let place = Vec3::new(random.uniform(), random.uniform(), random.uniform());
            let position = low + (high - low) * place;
            points.push((Receiver { position, normal: facing, geometric_normal: facing }, 0.0));
        }
        points
    }

    /// Shares for these points, from rays of their own; the mean luminance of the irradiance from emitters, W·m⁻²; and the
    /// places that cosine-distributed rays met. Groups that are not `counted` get no share.
    pub fn learn(
        &self,
        points: &[Receiver],
        counted: impl Fn(usize) -> bool,
        random: &mut Random,
    ) -> (Shares, f32, Vec<Link>) {
        let groups = self.emitters.groups();
        let few: Vec<&Receiver> = points.iter().step_by(points.len().div_ceil(POINTS_OF_IMPORTANCE)).collect();
        let mean = |g| few.iter().map(|p| f64::from(self.emitters.importance(g, p))).sum::<f64>() / few.len() as f64;
        let expected: Vec<f64> = (0..groups).map(|g| if counted(g) { mean(g) } else { 0.0 }).collect();
        let even = 1.0 / (0..groups).filter(|&g| counted(g)).count().max(1) as f64;
        let mut ranked: Vec<usize> = (0..groups).filter(|&g| expected[g] > 0.0).collect();
        ranked.sort_by(|&a, &b| expected[b].total_cmp(&expected[a]).then(a.cmp(&b)));
        ranked.truncate(TESTED);
        let of_ranked: f64 = ranked.iter().map(|&g| expected[g]).sum();
        let [least, most] = RAYS_PER_GROUP;
        let further = LIGHT_RAYS - least * ranked.len() as f64;
        let mut tested = vec![0.0f32; groups];
        let mut found = Vec::new();
        for (rank, &group) in ranked.iter().enumerate() {
            let per_group = (least + further * expected[group] / of_ranked).clamp(least, most).round() as usize;
            tested[group] = per_group as f32;
            for i in 0..per_group {
                found.extend(self.test_group(group, &points[(rank + i) % points.len()], random));
            }
        }
        let towards_emitters = found.len();
        let mut links = Vec::new();
        for i in 0..COSINE_RAYS {
            found.extend(self.test_cosine(&points[i % points.len()], random, &mut links));
        }
        // Densities of all rays at which each of these was found: the balance heuristic again.
        let all = |f: &Found| tested[f.group] * f.in_group + COSINE_RAYS as f32 * f.by_cosine;
        let mut second_moments = vec![0.0f64; groups];
        // A ray may meet an emitter by a hair's breadth that the tree holds to be out of reach.
        for f in found.iter().filter(|f| f.in_group > 0.0) {
            second_moments[f.group] += f64::from(f.light * f.light / (f.in_group * all(f)));
        }
        // The least variance has draws in proportion to the root of the second moment.
        let learnt: Vec<f64> = second_moments.iter().map(|m| m.sqrt()).collect();
        let (learnt_sum, expected_sum) = (learnt.iter().sum::<f64>(), expected.iter().sum::<f64>());
        let lit = learnt_sum > 0.0 && learnt_sum.is_finite();
        let defensive = if lit { DEFENSIVE } else { 1.0 };
        let weight = |g: usize| {
            let of = |value: f64, sum: f64| if sum > 0.0 && sum.is_finite() { value / sum } else { 0.0 };
            let even = if counted(g) { even } else { 0.0 };
            (1.0 - defensive) * of(learnt[g], learnt_sum) + 0.5 * defensive * (of(expected[g], expected_sum) + even)
        };
        let weights: Vec<f64> = (0..groups).map(weight).collect();
        let mut shares = Shares::new(&weights);
        shares.lit = lit;
        let from_all_sides = found.len() - towards_emitters == COSINE_RAYS;
        let all_even = self.emitters.is_uniform_sky() || from_all_sides && is_even(&found);
        shares.cosine = if all_even { 1.0 } else { best_cosine_share(&shares, &found, all) };
        let direct = found.iter().map(|f| f.light / all(f)).sum();
        (shares, direct, links)
    }

    fn test_group(&self, group: usize, receiver: &Receiver, random: &mut Random) -> Option<Found> {
        let bits = std::array::from_fn(|_| random.bits());
        let sample = self.emitters.sample_group(self.scene, group, receiver, bits)?;
        let light = luminance(sample.radiance) * receiver.cosine(sample.direction);
        let arrives = light > 0.0 && self.reaches(receiver.position, &sample, random.bits());
        let by_cosine = if sample.is_punctual() { 0.0 } else { density_of_test(receiver, sample.direction) };
        arrives.then_some(Found { group, light, in_group: sample.density, by_cosine })
    }

    fn test_cosine(&self, receiver: &Receiver, random: &mut Random, links: &mut Vec<Link>) -> Option<Found> {
        let u = Vec2::new(random.uniform(), random.uniform());
        let direction = if receiver.has_normal() { cosine_hemisphere(receiver.normal, u) } else { uniform_sphere(u) };
        let cosine = receiver.cosine(direction);
        if cosine <= 0.0 {
            return None;
        }
        let ray = Ray::new(receiver.position, direction, random.bits());
        let hit = self.tracer.closest(ray);
        if let Some(hit) = hit {
            let surface = self.surface_at(hit, direction);
            let albedo = luminance(surface.albedo) / COSINE_RAYS as f32;
            links.push(Link { place: self.places.key_of(&surface) as u32, albedo });
        }
        let emission = self.emission_of(receiver, direction, hit)?;
        let light = luminance(emission.radiance) * cosine;
        let by_cosine = density_of_test(receiver, direction);
        let found = Found { group: emission.group, light, in_group: emission.density, by_cosine };
        (found.light > 0.0).then_some(found)
    }
}

/// Density of the rays that do not know of emitters, sr⁻¹.
fn density_of_test(receiver: &Receiver, direction: Vec3) -> f32 {
    if receiver.has_normal() {
        cosine_hemisphere_density(receiver.normal.dot(direction))
    } else {
        UNIFORM_SPHERE_DENSITY
    }
}

/// Whether all light that was found has about the same radiance. Where it comes from all sides, rays towards emitters then
/// only add noise.
fn is_even(found: &[Found]) -> bool {
    // Punctual light is no radiance: infinite here.
    let radiances = || found.iter().map(|f| f.light / f.by_cosine);
    let (least, most) = (radiances().fold(f32::INFINITY, f32::min), radiances().fold(0.0, f32::max));
    least >= EVEN * most
}

/// The share of cosine-distributed samples at which the mixture of both techniques has the least second moment.
fn best_cosine_share(shares: &Shares, found: &[Found], all: impl Fn(&Found) -> f32) -> f32 {
    let moment = |share: f32| {
        let of = |f: &Found| {
            let mixed = share * f.by_cosine + (1.0 - share) * shares.of(f.group) * f.in_group;
            f64::from(f.light * f.light / (mixed * all(f)))
        };
        found.iter().map(of).sum::<f64>()
    };
    COSINE_SHARES.into_iter().min_by(|&a, &b| moment(a).total_cmp(&moment(b))).unwrap_or(0.5)
}
