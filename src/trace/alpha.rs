//! Tests of hits. Rays pass MASK surfaces where their alpha is low, BLEND surfaces by chance, and any surface where
//! another one lies in front of it in the same plane ([`crate::scene::Covers`]).

use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};

use embree4_sys::RTCFilterFunctionNArguments;
use glam::{Vec2, Vec3};

use crate::math::random::hash_to_unit;
use crate::scene::{Scene, TriangleIndex};

// Offsets of the fields in Embree's ray and hit packets of size one (rtcore_ray.h), in 32-bit words.
const RAY_DIRECTION_X: usize = 4;
const RAY_ID: usize = 10;
const HIT_U: usize = 3;
const HIT_V: usize = 4;
const HIT_PRIMITIVE: usize = 5;

/// Embree's filter callback: rejects a hit by clearing `valid`. The geometry's user pointer is the [`Scene`].
///
/// # Safety
/// Called by Embree with packets of size one (the only ones this crate traces) and the user pointer that
/// [`super::Tracer`] set, which outlives the geometry.
pub unsafe extern "C" fn filter(arguments: *const RTCFilterFunctionNArguments) {
    // SAFETY: Embree passes a valid argument block for the duration of the call.
    let arguments = unsafe { &*arguments };
    debug_assert_eq!(arguments.N, 1);
    let (ray, hit) = (arguments.ray as *const u32, arguments.hit as *const u32);
    // SAFETY: packets of size one are plain runs of 32-bit words; the indices above lie inside them.
    let (salt, direction, u, v, primitive) = unsafe {
        (
            *ray.add(RAY_ID),
            [0, 1, 2].map(|axis| *ray.add(RAY_DIRECTION_X + axis)),
            f32::from_bits(*hit.add(HIT_U)),
            f32::from_bits(*hit.add(HIT_V)),
            *hit.add(HIT_PRIMITIVE),
        )
    };
    let direction_bits = direction[0] ^ direction[1].rotate_left(11);
    let direction = Vec3::from_array(direction.map(f32::from_bits));
    // SAFETY: `Tracer` set this pointer to a scene that it borrows for its whole life.
    let scene = unsafe { &*(arguments.geometryUserPtr as *const Scene) };
    // A panic must not unwind into Embree. None is expected, because the loader has checked every index.
    let stopped = catch_unwind(AssertUnwindSafe(|| {
        let triangle = TriangleIndex(scene.mesh.opaque_count as u32 + primitive);
        let place = Vec2::new(u, v);
        // The random number depends on the ray and the triangle, so the order in which Embree visits triangles has no
        // effect.
        let stops = |triangle: TriangleIndex, place: Vec2| {
            let number = triangle.0.wrapping_sub(scene.mesh.opaque_count as u32);
            scene.opacity(triangle, place) > hash_to_unit(salt, direction_bits, number)
        };
        // What stops the ray in front, in the same plane, is another hit of the same ray.
        stops(triangle, place) && !scene.covers_at(triangle, place, direction).any(|(by, place)| stops(by, place))
    }))
    .unwrap_or(true);
    if !stopped {
        // SAFETY: `valid` points to one word.
        unsafe { *arguments.valid = 0 };
    }
}

/// The user pointer that [`filter`] reads.
pub fn user_pointer(scene: &Scene) -> *mut c_void {
    std::ptr::from_ref(scene).cast_mut().cast()
}
