//! What every loaded scene promises, and files damaged so that loading them may break a promise.

use glam::Vec3;
use lightprobe::scene::{AlphaMode, LoadOptions, Scene, Texels, TriangleIndex, load};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng;

/// Fails where a scene is not what its type says.
pub fn check(scene: &Scene) {
    let mesh = &scene.mesh;
    let vertices = mesh.positions.len();
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
    assert!(mesh.normals.iter().all(|n| *n == Vec3::ZERO || (n.length() - 1.0).abs() < 1e-5));
    assert!(mesh.uvs.iter().all(|uvs| uvs.len() == vertices && uvs.iter().all(|uv| uv.is_finite())));
    assert!(mesh.normals.len() == vertices);
    assert!(mesh.colors.is_empty() || mesh.colors.len() == vertices);
    assert!(mesh.tangents.is_empty() || mesh.tangents.len() == vertices);
    assert!(mesh.colors.iter().chain(&mesh.tangents).all(|v| v.is_finite()));
    assert!(mesh.triangles.iter().flatten().all(|&index| (index as usize) < vertices));
    assert_eq!(mesh.triangles.len(), mesh.materials.len());
    assert!(!mesh.triangles.is_empty());
    for (number, material) in mesh.materials.iter().enumerate() {
        let opaque = scene.materials[material.0 as usize].alpha_mode == AlphaMode::Opaque;
        // What lies in the plane of an emitter does not stop every ray.
        let covered = !mesh.covers.of(TriangleIndex(number as u32)).is_empty();
        assert_eq!(opaque && !covered, number < mesh.opaque_count);
    }
    for m in &scene.materials {
        for slot in [m.base_color_texture, m.metallic_roughness_texture, m.emission_texture, m.normal_texture] {
            assert!(slot.is_none_or(|s| (s.texture.0 as usize) < scene.textures.len() && s.uv_set < 2));
        }
        assert!(m.base_color.is_finite() && m.emission.is_finite());
    }
    for texture in &scene.textures {
        let texels = texture.width as usize * texture.height as usize;
        assert!(texels > 0);
        assert_eq!(
            texels,
            match &texture.texels {
                Texels::Rgba8 { data, .. } => data.len(),
                Texels::Rgba32F(data) => data.len(),
            }
        );
    }
    assert!(scene.origin_world.is_finite());
    assert!(scene.cameras.iter().all(|c| c.position.is_finite() && c.world_from_camera.is_finite()));
    let names: std::collections::HashSet<_> = scene.cameras.iter().map(|c| &c.name).collect();
    assert_eq!(names.len(), scene.cameras.len());
    assert_eq!(scene.blake3.len(), 64);
    assert!(scene.warnings.iter().all(|w| !w.contains('\n')));
}

/// A copy with a few bytes changed or its end cut off.
pub fn damage(bytes: &[u8], rng: &mut Pcg32) -> Vec<u8> {
    let mut copy = bytes.to_vec();
    for _ in 0..1 + rng.next_u32() % 4 {
        let at = rng.next_u32() as usize % copy.len();
        copy[at] = match rng.next_u32() % 3 {
            0 => rng.next_u32() as u8,
            1 => copy[at] ^ (1 << (rng.next_u32() % 8)),
            _ => b"0123456789-\"[]{},"[rng.next_u32() as usize % 17],
        };
    }
    if rng.next_u32().is_multiple_of(4) {
        copy.truncate(rng.next_u32() as usize % copy.len());
    }
    copy
}

/// Loads 200 damaged copies of each file: a scene that keeps its promises, or one line of error.
pub fn assert_damage_is_survived(files: &[Vec<u8>], rng: &mut Pcg32) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("damaged.glb");
    let mut ok = 0;
    for bytes in files {
        for _ in 0..200 {
            std::fs::write(&path, damage(bytes, rng)).expect("a file in a temporary folder");
            match load(&path, &LoadOptions::default()) {
                Ok(scene) => {
                    check(&scene);
                    ok += 1;
                }
                Err(e) => assert!(!e.to_string().contains('\n'), "{e}"),
            }
        }
    }
    assert!(ok > 0, "every damaged file is refused: the damage is not subtle enough to test anything");
}
