//! Measures the processor time of a 50-frame clip, the driver's threads included:
//! `cargo run --release -p render --example bench`.

mod scenes;

/// Processor time of this process so far, milliseconds, in steps of 10.
fn cpu_ms() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let fields: Vec<f64> = after_name
        .split_whitespace()
        .skip(11)
        .take(2)
        .filter_map(|f| f.parse().ok())
        .collect();
    // The kernel counts these in hundredths of a second on every Linux that Rust runs on.
    fields.iter().sum::<f64>() * 10.0
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    const N_CLIPS: u32 = 8;
    let start = cpu_ms();
    let renderer = render::Renderer::new()?;
    let scene = scenes::window();
    let frames: Vec<_> = (0..50)
        .map(|t| {
            let t = t as f32 / 49.0;
            let hand = [-0.05 + 0.2 * t, 0.56 + 0.05 * t, 0.35 - 0.27 * t];
            scenes::window_frame(hand, 1.0 - t, 0.19 * t * t)
        })
        .collect();
    for camera in &scene.cameras {
        renderer.draw(&scene, &frames[..2], render::CLIP_SIZE, camera)?;
    }
    println!(
        "{}: first pictures after {:.0} ms CPU",
        renderer.device_name(),
        cpu_ms() - start
    );
    for camera in &scene.cameras {
        let (mut drawing, mut encoding, mut bytes) = (0.0, 0.0, 0);
        for _ in 0..N_CLIPS {
            let before = cpu_ms();
            let images = renderer.draw(&scene, &frames, render::CLIP_SIZE, camera)?;
            let between = cpu_ms();
            let clip = render::clip::encode(&images, 25)?;
            drawing += between - before;
            encoding += cpu_ms() - between;
            bytes = clip.bytes.len();
        }
        let n = f64::from(N_CLIPS);
        println!(
            "{:8} {:5.1} ms CPU per frame, encoding {:5.1} ms per clip, whole clip {:6.0} ms CPU, {bytes} bytes",
            camera.name,
            drawing / n / frames.len() as f64,
            encoding / n,
            (drawing + encoding) / n,
        );
    }
    Ok(())
}
