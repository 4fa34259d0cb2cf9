//! A screen in memory: what egui paints, by lavapipe.

use std::cell::RefCell;
use std::rc::Rc;

use eframe::egui_wgpu::{Renderer, RendererOptions, ScreenDescriptor, wgpu};
use egui::TexturesDelta;
use egui_kittest::{Harness, TestRenderer};
use ivd_view::Window;

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

struct Drawing {
    device: wgpu::Device,
    queue: wgpu::Queue,
    renderer: Renderer,
}

/// A screen; clones are the same one.
#[derive(Clone)]
pub(crate) struct Screen(Rc<RefCell<Drawing>>);

/// A screen on the adapter that tests expect; `None` where they expect none.
///
/// # Panics
/// Where `IVD_EXPECT_ADAPTER` names an adapter that isn't there.
pub(crate) fn screen() -> Option<Screen> {
    let expected = std::env::var("IVD_EXPECT_ADAPTER").unwrap_or_default();
    if expected.is_empty() {
        return None;
    }
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::PRIMARY;
    let instance = wgpu::Instance::new(descriptor);
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let adapter = adapters.into_iter().find(|adapter| adapter.get_info().name.contains(&expected));
    let adapter = adapter.unwrap_or_else(|| panic!("there is no adapter {expected}"));
    let device = adapter.request_device(&wgpu::DeviceDescriptor::default());
    let (device, queue) = pollster::block_on(device).unwrap();
    let renderer = Renderer::new(&device, FORMAT, RendererOptions::PREDICTABLE);
    Some(Screen(Rc::new(RefCell::new(Drawing { device, queue, renderer }))))
}

impl TestRenderer for Screen {
    fn handle_delta(&mut self, delta: &mut TexturesDelta) {
        let Drawing { device, queue, renderer } = &mut *self.0.borrow_mut();
        for (id, images) in delta.set.drain() {
            images.iter().for_each(|image| renderer.update_texture(device, queue, id, image));
        }
        delta.free.drain().for_each(|id| renderer.free_texture(&id));
    }
}

impl Screen {
    /// What is painted, as width, height and RGBA. Fails where wgpu finds anything wrong with it.
    pub(crate) fn paint(&self, harness: &Harness<'_, Window>) -> (usize, usize, Vec<u8>) {
        let Drawing { device, queue, renderer } = &mut *self.0.borrow_mut();
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let size = harness.ctx.content_rect().size();
        let [width, height] = [size.x, size.y].map(|side| side.round() as u32);
        let descriptor = ScreenDescriptor { size_in_pixels: [width, height], pixels_per_point: 1.0 };
        let jobs = harness.ctx.tessellate(harness.output().shapes.clone(), 1.0);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let buffers = renderer.update_buffers(device, queue, &mut encoder, &jobs, &descriptor);
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut pass = encoder
            .begin_render_pass(&wgpu::RenderPassDescriptor {
                label: None,
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                    depth_slice: None,
                })],
                ..wgpu::RenderPassDescriptor::default()
            })
            .forget_lifetime();
        renderer.render(&mut pass, &jobs, &descriptor);
        drop(pass);
        queue.submit(buffers.into_iter().chain([encoder.finish()]));
        let pixels = read(device, queue, &texture, [width, height]);
        let wrong = pollster::block_on(scope.pop());
        assert!(wrong.is_none(), "{wrong:?}");
        (width as usize, height as usize, pixels)
    }
}

/// The bytes of a texture.
fn read(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    texture: &wgpu::Texture,
    [width, height]: [u32; 2],
) -> Vec<u8> {
    let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row * height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
        },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    buffer.slice(..).map_async(wgpu::MapMode::Read, |mapped| mapped.unwrap());
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let bytes = buffer.slice(..).get_mapped_range().unwrap();
    bytes.chunks(row as usize).flat_map(|line| line[..4 * width as usize].to_vec()).collect()
}
