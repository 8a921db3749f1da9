/* SPDX-License-Identifier: Apache-2.0 */
/* Registers of a frame: camera and lights; room and outline are in files of their own: docs/driver.md. */
#include "colonnade_view_parts.h"
#include "colonnade_words.h"

int colonnade_find_blocks(const struct colonnade_view_scene *scene,
                          struct colonnade_block blocks[COLONNADE_MAX_BLOCKS]) {
    const uint32_t words = colonnade_mac_words(scene);
    blocks[0] = (struct colonnade_block){scene->frame_address, VIEW_FRAME, COLONNADE_VIEW_FRAME};
    blocks[1] = (struct colonnade_block){scene->camera_address, VIEW_CAMERA, 12 * words + 1};
    blocks[2] = (struct colonnade_block){scene->lights_address, VIEW_LIGHTS, (3 * words + 5) * scene->lights};
    blocks[3] = (struct colonnade_block){scene->environment_address, VIEW_ENVIRONMENT, 12 * words + 11};
    const uint32_t window = scene->scene_bits + scene->more_grid_bits > 42 ? 8 : 7;
    blocks[4] = (struct colonnade_block){scene->window_address, VIEW_WINDOW, window};
    int count = scene->environment_address == 0 ? 3 : scene->window == WINDOW_CONSTANT ? 4 : 5;
    if (scene->gather_address != 0)
        blocks[count++] = (struct colonnade_block){scene->gather_address, VIEW_GATHER, COLONNADE_VIEW_GATHER};
    return count;
}

/* The words of a light. */
static uint32_t *find_light(struct colonnade_view *view, uint32_t index) {
    return colonnade_computed(view) + VIEW_LIGHTS + (3 * colonnade_mac_words(&view->scene) + 5) * index;
}

/* Camera and lights, shifted right until the largest fits its register. */
static void set_positions(struct colonnade_view *view, struct colonnade_work *work) {
    const struct colonnade_view_scene *scene = &view->scene;
    const int64_t limit = ((int64_t)1 << (scene->mac_bits - 1)) - 1;
    uint64_t most = colonnade_largest(work->eye);
    for (uint32_t i = 0; i < scene->lights; ++i) {
        const uint64_t size = colonnade_largest(work->lights[i]);
        if (size > most) most = size;
    }
    int shift = colonnade_bit_length(most) - scene->mac_bits - 15;
    if (shift < 0) shift = 0;
    if (colonnade_nearest((int64_t)most, 16 + shift) > limit) ++shift;
    work->unit_shift = shift;
    /* A wider register takes the shift as low bits of 0 */
    const int in_steps = shift + scene->more_grid_bits;
    const int low_bits = in_steps < scene->more_mac_bits ? in_steps : scene->more_mac_bits;
    uint32_t *words = colonnade_computed(view), *to = words + VIEW_CAMERA;
    words[VIEW_UNIT_SHIFT] = (uint32_t)(in_steps - low_bits);
    for (int axis = 0; axis < 3; ++axis)
        to = colonnade_set_mac(scene, to, colonnade_nearest(work->eye[axis], 16 + shift), low_bits);
    for (uint32_t i = 0; i < scene->lights; ++i) {
        to = find_light(view, i);
        for (int axis = 0; axis < 3; ++axis)
            to = colonnade_set_mac(scene, to, colonnade_nearest(work->lights[i][axis], 16 + shift), low_bits);
    }
}

/* A light's colour, and its squared reach in grid steps, as mantissa and exponent. */
static void set_light(struct colonnade_view *view, uint32_t index) {
    const struct colonnade_view_scene *scene = &view->scene;
    const struct colonnade_light *light = &view->lights[index];
    uint32_t *words = find_light(view, index) + 3 * colonnade_mac_words(scene);
    for (int channel = 0; channel < 3; ++channel) {
        const uint64_t colour = (uint64_t)light->colour[channel] * scene->exposure; /* 2^-32; the register has 2^-12 */
        const uint64_t rounded = (colour >> 20) + (colour >> 19 & 1);
        words[channel] = rounded > 0xFFFF ? 0xFFFF : (uint32_t)rounded;
    }
    words[3] = words[4] = 0;
    if (light->reach == 0) return;
    int up = 64 - colonnade_bit_length(light->reach);
    uint64_t steps = colonnade_multiply_high(light->reach << up, scene->steps.mantissa);
    int exponent = 64 - up - 32 + scene->steps.exponent;
    up = 64 - colonnade_bit_length(steps);
    steps <<= up;
    exponent = 2 * (exponent - up) + 128;
    uint64_t square = colonnade_multiply_high(steps, steps);
    up = 64 - colonnade_bit_length(square);
    square <<= up;
    exponent -= up;
    const int down = 64 - scene->mantissa_bits;
    uint64_t mantissa = ((square >> (down - 1)) + 1) >> 1;
    if (mantissa >> scene->mantissa_bits != 0) mantissa >>= 1, ++exponent;
    exponent += 2 * scene->more_grid_bits - scene->mantissa_bits;
    /* Beyond the register's range the light has all or none of its intensity */
    const int32_t limit = colonnade_exponent_limit(scene);
    if (exponent > limit) return;
    words[3] = (uint32_t)mantissa;
    words[4] = (uint32_t)(exponent < -limit - 1 ? -limit - 1 : exponent) & (2 * (uint32_t)limit + 1);
}

/* Directions times fx * fy need no division: (x + 1/2 - cx) * fy * right + (y + 1/2 - cy) * fx * down + fx * fy *
 * forward; the sample's shift moves the centre of a pixel. One division scales them, so that the largest component in
 * the frame is 2^(macBits - 2). */
static void set_directions(struct colonnade_view *view, const struct colonnade_work *work,
                           struct colonnade_view_rays *rays) {
    const struct colonnade_view_scene *scene = &view->scene;
    const struct colonnade_camera *camera = &view->camera;
    const int bits = scene->mac_bits;
    const int64_t to_x = COLONNADE_PIXEL / 2 + view->sample.shift[0] - camera->cx;
    const int64_t to_y = COLONNADE_PIXEL / 2 + view->sample.shift[1] - camera->cy;
    const int up =
        62 - colonnade_bit_length((uint64_t)camera->fx | (uint64_t)camera->fy | colonnade_magnitude(to_x) |
                                  colonnade_magnitude(to_y) | (uint64_t)(camera->width | camera->height) << 32);
    const int64_t fx = camera->fx << up, fy = camera->fy << up;
    const int64_t factors[5] = {colonnade_product(colonnade_shift_left(to_x, up), fy),
                                colonnade_product(colonnade_shift_left(to_y, up), fx), colonnade_product(fx, fy),
                                fy >> (32 - up), fx >> (32 - up)}; /* a pixel has 33 bits */
    int64_t vectors[3][3], *first = vectors[0], *along_x = vectors[1], *along_y = vectors[2];
    int32_t *results[3] = {rays->first, rays->step_x, rays->step_y};
    uint64_t most = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const int64_t right = work->axes[0][axis], down = work->axes[1][axis];
        first[axis] = colonnade_product(factors[0], right) + colonnade_product(factors[1], down) +
                      colonnade_product(factors[2], work->axes[2][axis]);
        along_x[axis] = colonnade_product(factors[3], right);
        along_y[axis] = colonnade_product(factors[4], down);
        const int64_t wide = (int64_t)(camera->width - 1) * along_x[axis];
        const int64_t high = (int64_t)(camera->height - 1) * along_y[axis];
        const int64_t low = first[axis] + (wide < 0 ? wide : 0) + (high < 0 ? high : 0);
        const int64_t top = first[axis] + (wide > 0 ? wide : 0) + (high > 0 ? high : 0);
        const int64_t size = top > -low ? top : -low; /* at a corner of the frame */
        if ((uint64_t)size > most) most = (uint64_t)size;
    }
    /* Steps larger than the directions, in a frame of few pixels, are scaled to their largest value, 2^(bits - 1) - 2
     */
    const uint64_t step_x = colonnade_largest(along_x), step_y = colonnade_largest(along_y);
    const uint64_t step = step_x > step_y ? step_x : step_y;
    const bool by_step = step > 2 * most - (most >> (bits - 3));
    if (by_step) most = step;
    const int normal = 64 - colonnade_bit_length(most);
    const uint64_t reciprocal = colonnade_reciprocal(most << normal);
    const int64_t bound = (((int64_t)1 << (bits - 1)) - 2) << (63 - bits);
    int64_t largest_step = 0;
    for (int i = 0; i < 3; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            const int64_t value = vectors[i][axis];
            int64_t size = (int64_t)colonnade_multiply_high(colonnade_magnitude(value) << (normal - 1), reciprocal);
            if (by_step) size = 2 * (size - (size >> (bits - 2)));
            if (i > 0 && size > largest_step) largest_step = size;
            vectors[i][axis] = colonnade_signed((uint64_t)size, value < 0);
        }
    /* The bound has 62 bits */
    rays->shift = 61 - colonnade_bit_length((uint64_t)largest_step);
    if (rays->shift < 0) rays->shift = 0;
    while (bound >> (rays->shift + 1) >= largest_step && rays->shift < scene->coordinate_bits) ++rays->shift;
    if (rays->shift > scene->coordinate_bits) rays->shift = scene->coordinate_bits;
    for (int i = 0; i < 3; ++i) {
        const int down = 63 - bits - (i > 0 ? rays->shift : 0);
        const int64_t half = (int64_t)1 << (down - 1);
        for (int axis = 0; axis < 3; ++axis) results[i][axis] = (int32_t)((vectors[i][axis] + half) >> down);
    }
    uint32_t *to = colonnade_computed(view) + VIEW_CAMERA + 3 * colonnade_mac_words(scene);
    for (int i = 0; i < 3; ++i)
        for (int axis = 0; axis < 3; ++axis) to = colonnade_set_mac(scene, to, results[i][axis], scene->more_mac_bits);
    *to = (uint32_t)rays->shift;
}

static enum colonnade_error compute(struct colonnade_view *view) {
    const struct colonnade_view_scene *scene = &view->scene;
    struct colonnade_work work;
    if (!colonnade_find_sight(view, &view->camera.pose, &work)) return COLONNADE_TOO_FAR;
    for (uint32_t i = 0; i < scene->lights; ++i)
        if (!colonnade_find_on_grid(view, view->lights[i].position, work.lights[i])) return COLONNADE_TOO_FAR;
    colonnade_computed(view)[VIEW_FRAME] = view->camera.width;
    colonnade_computed(view)[VIEW_FRAME + 1] = view->camera.height;
    set_positions(view, &work);
    for (uint32_t i = 0; i < scene->lights; ++i) set_light(view, i);
    for (int i = 0; scene->gather_address != 0 && i < COLONNADE_VIEW_GATHER; ++i)
        colonnade_computed(view)[VIEW_GATHER + i] = view->sample.points[i / 2][i % 2];
    struct colonnade_view_rays rays;
    set_directions(view, &work, &rays);
    colonnade_view_outline(view, &work, &rays);
    return scene->environment_address == 0 ? COLONNADE_OK : colonnade_view_room(view, &work);
}

uint32_t colonnade_view_most_writes(const struct colonnade_view *view) {
    struct colonnade_block blocks[COLONNADE_MAX_BLOCKS];
    const int count = colonnade_find_blocks(&view->scene, blocks);
    uint32_t most = view->scene.constants;
    for (int i = 0; i < count; ++i) most += blocks[i].count;
    return most;
}

enum colonnade_error colonnade_view_frame(struct colonnade_view *view, uint8_t *writes, uint32_t capacity,
                                          struct colonnade_frame *frame) {
    if (capacity < colonnade_view_most_writes(view)) return COLONNADE_TOO_LARGE;
    view->is_computed = false;
    enum colonnade_error error = compute(view);
    if (error != COLONNADE_OK) return error;
    view->is_computed = true;
    const bool is_known = view->is_known;
    const uint32_t *words = colonnade_computed(view), *accepted = view->words[view->accepted];
    uint8_t *to = writes;
    if (!is_known)
        for (size_t byte = 0; byte < 8 * (size_t)view->scene.constants; ++byte) *to++ = view->scene.writes[byte];
    struct colonnade_block blocks[COLONNADE_MAX_BLOCKS];
    const int used = colonnade_find_blocks(&view->scene, blocks);
    for (int i = 0; i < used; ++i) {
        const struct colonnade_block block = blocks[i];
        for (uint32_t word = 0; word < block.count; ++word) {
            const uint32_t value = words[block.place + word];
            if (is_known && value == accepted[block.place + word]) continue;
            colonnade_write_word(to, block.address + word);
            colonnade_write_word(to + 4, value);
            to += 8;
        }
    }
    const uint32_t count = (uint32_t)((to - writes) / 8);
    *frame = (struct colonnade_frame){writes, count, view->camera.width, view->camera.height};
    return COLONNADE_OK;
}

void colonnade_view_accept(struct colonnade_view *view) {
    if (!view->is_computed) return;
    view->accepted = !view->accepted;
    view->is_computed = false;
    view->is_known = true;
}

void colonnade_view_forget(struct colonnade_view *view) { view->is_known = false; }
