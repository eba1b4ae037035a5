//! Draws the reference moments of window-open: `cargo run -p render --example picture OUT.png`.

mod scenes;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out = std::env::args().nth(1).ok_or("usage: picture OUT.png")?;
    let renderer = render::Renderer::new()?;
    println!("{}", renderer.device_name());
    let scene = scenes::window();
    let frames = [
        scenes::window_frame([-0.0477, 0.5555, 0.3559], 0.0, 0.0),
        scenes::window_frame([-0.0519, 0.6048, 0.2512], 0.0, 0.0),
        scenes::window_frame([-0.023, 0.6077, 0.0673], 0.0, 0.0005),
        scenes::window_frame([0.1686, 0.605, 0.0826], 0.0, 0.194),
    ];
    let mut images = Vec::new();
    for camera in &scene.cameras {
        images.extend(renderer.draw(&scene, &frames, render::CLIP_SIZE, camera)?);
    }
    render::contact_sheet(&images)?.save(out)?;
    Ok(())
}
