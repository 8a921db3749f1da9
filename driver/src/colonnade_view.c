/* Camera, lights and outline: docs/driver.md. */
#include "colonnade_view_parts.h"
#include "colonnade_words.h"

enum { VERSION = 3, HEADER_WORDS = 12, FIXED_WORDS = 85, LIGHT_WORDS = 11, ROOM_WORDS = 49, TILE_WORDS = 2 };
enum { OUTLINE_NORMAL = 2047, WORLD_BITS = 60, ROTATION_BITS = 30, MAC_BITS = 32, SCENE_BITS = 40 };

/* Reads a view file word by word; its length is checked before. */
struct reader {
    const uint8_t *bytes;
    size_t next;
};

static uint32_t read_word(struct reader *reader) { return colonnade_word(reader->bytes, reader->next++); }

static int32_t read_signed(struct reader *reader) { return (int32_t)read_word(reader); }

static uint64_t read_wide(struct reader *reader) {
    const uint64_t low = read_word(reader);
    return low | (uint64_t)read_word(reader) << 32;
}

static void read_vector(struct reader *reader, int64_t vector[3]) {
    for (int axis = 0; axis < 3; ++axis) vector[axis] = (int64_t)read_wide(reader);
}

static void read_pose(struct reader *reader, struct colonnade_pose *pose) {
    read_vector(reader, pose->position);
    for (int i = 0; i < 9; ++i) pose->rotation[i / 3][i % 3] = read_signed(reader);
}

static bool read_factor(struct reader *reader, struct colonnade_factor *factor) {
    factor->mantissa = read_wide(reader);
    factor->exponent = read_signed(reader);
    return factor->mantissa >> 63 != 0 && factor->exponent > -256 && factor->exponent < 256;
}

static bool is_within(int64_t value, int64_t low, int64_t high) { return low <= value && value <= high; }

static bool is_lens(int64_t fx, int64_t fy, int64_t cx, int64_t cy) {
    const int64_t least = COLONNADE_PIXEL / 16, most = COLONNADE_PIXEL << 24;
    return is_within(fx, least, most) && is_within(fy, least, most) && is_within(cx, -most, most) && is_within(cy, -most, most);
}

static bool is_place(const int64_t position[3]) { return colonnade_block_length(position) <= WORLD_BITS; }

/* A width of at most `most` bits, limited to what is computed; the rest goes to `more`. */
static int32_t read_width(struct reader *reader, int32_t limit, int32_t most, int32_t *more) {
    const int32_t bits = read_signed(reader);
    *more = bits > limit && bits <= most ? bits - limit : 0;
    return bits - *more;
}

static bool read_numbers(struct reader *reader, struct colonnade_view_scene *scene) {
    scene->mac_bits = read_width(reader, MAC_BITS, 64, &scene->more_mac_bits);
    scene->scene_bits = read_width(reader, SCENE_BITS, 72, &scene->more_grid_bits);
    const int32_t fraction = read_signed(reader);
    const bool is_fraction = is_within(fraction, -12, 64);
    scene->grid_fraction = is_fraction ? fraction - scene->more_grid_bits : 0;
    scene->coordinate_bits = read_signed(reader);
    scene->box_pad_log = read_signed(reader);
    scene->mantissa_bits = read_signed(reader);
    scene->vertex_bits = read_signed(reader);
    scene->max_width = read_word(reader);
    scene->max_height = read_word(reader);
    scene->exposure = read_word(reader);
    scene->frame_address = read_word(reader);
    scene->camera_address = read_word(reader);
    scene->lights_address = read_word(reader);
    scene->environment_address = read_word(reader);
    scene->window_address = read_word(reader);
    scene->gather_address = read_word(reader);
    return is_within(scene->mac_bits, 16, MAC_BITS) && is_within(scene->scene_bits, 16, SCENE_BITS) && is_fraction &&
           is_within(scene->grid_fraction, -12, 19) && is_within(scene->coordinate_bits, 4, 13) &&
           is_within(scene->box_pad_log, 0, 24) && is_within(scene->mantissa_bits, 8, 32) &&
           is_within(scene->vertex_bits, 8, 24) && scene->max_width <= 4096 && scene->max_height <= 4096;
}

static bool read_mesh(struct reader *reader, struct colonnade_view_scene *scene) {
    bool is_good = read_factor(reader, &scene->steps);
    read_vector(reader, scene->offset);
    for (int axis = 0; axis < 3; ++axis) scene->low[axis] = read_signed(reader);
    for (int axis = 0; axis < 3; ++axis) scene->high[axis] = read_signed(reader);
    for (int axis = 0; axis < 3; ++axis)
        is_good &= is_within(scene->low[axis], 0, scene->high[axis]) &&
                   is_within(scene->high[axis], 0, ((int64_t)1 << scene->vertex_bits) - 1);
    return is_good && is_place(scene->offset);
}

static bool read_room(struct reader *reader, struct colonnade_view_scene *scene) {
    bool is_good = read_factor(reader, &scene->metres);
    is_good &= read_factor(reader, &scene->projection);
    int64_t *lens = scene->map_lens;
    for (int i = 0; i < 4; ++i) lens[i] = (int64_t)read_wide(reader);
    is_good &= is_lens(lens[0], lens[1], lens[2], lens[3]);
    read_pose(reader, &scene->map_pose);
    read_vector(reader, scene->room_low);
    read_vector(reader, scene->room_high);
    scene->window = read_word(reader);
    scene->occlusion = read_word(reader);
    scene->edge = read_word(reader);
    scene->max_tolerance = read_word(reader);
    scene->tile_size = read_word(reader);
    scene->tile_columns = read_word(reader);
    scene->tile_rows = read_word(reader);
    return is_good && is_place(scene->room_low) && is_place(scene->room_high) && scene->tile_size >= 1 &&
           scene->tile_size <= 4096 && scene->tile_columns <= 4096 && scene->tile_rows <= 4096;
}

/* Whether rows are unit and at right angles, to 2^-20, and right-handed, and the position is in the world. */
static bool is_pose(const struct colonnade_pose *pose) {
    const int32_t most = ((int32_t)1 << ROTATION_BITS) + 1024;
    const int64_t one = (int64_t)1 << (2 * ROTATION_BITS), error = one >> 20;
    for (int i = 0; i < 9; ++i)
        if (!is_within(pose->rotation[i / 3][i % 3], -most, most)) return false;
    int64_t volume = 0;
    for (int i = 0; i < 3; ++i) {
        const int32_t *row = pose->rotation[i], *next = pose->rotation[(i + 1) % 3];
        int64_t length = 0, angle = 0;
        for (int axis = 0; axis < 3; ++axis) {
            length += (int64_t)row[axis] * row[axis];
            angle += (int64_t)row[axis] * next[axis];
        }
        if (!is_within(length, one - error, one + error) || !is_within(angle, -error, error)) return false;
        const int32_t *second = pose->rotation[1], *third = pose->rotation[2];
        const int b = (i + 1) % 3, c = (i + 2) % 3;
        const int64_t minor = (int64_t)second[b] * third[c] - (int64_t)second[c] * third[b];
        volume += colonnade_nearest(minor, 32) * (pose->rotation[0][i] / 4);
    }
    return volume > 0 && is_place(pose->position);
}

static enum colonnade_error check_camera(const struct colonnade_view_scene *scene, const struct colonnade_camera *camera) {
    if (!is_pose(&camera->pose)) return COLONNADE_BAD_POSE;
    if (!is_lens(camera->fx, camera->fy, camera->cx, camera->cy) || camera->width == 0 || camera->height == 0)
        return COLONNADE_BAD_LENS;
    return camera->width > scene->max_width || camera->height > scene->max_height ? COLONNADE_TOO_LARGE : COLONNADE_OK;
}

/* The words that a device of this scene has, block by block. */
enum { MAX_BLOCKS = 6 };

struct block {
    uint32_t address, place, count;
};

static int find_blocks(const struct colonnade_view_scene *scene, struct block blocks[MAX_BLOCKS]) {
    const uint32_t words = colonnade_mac_words(scene);
    blocks[0] = (struct block){scene->frame_address, VIEW_FRAME, COLONNADE_VIEW_FRAME};
    blocks[1] = (struct block){scene->camera_address, VIEW_CAMERA, 12 * words + 1};
    blocks[2] = (struct block){scene->lights_address, VIEW_LIGHTS, (3 * words + 5) * scene->lights};
    blocks[3] = (struct block){scene->environment_address, VIEW_ENVIRONMENT, 12 * words + 11};
    blocks[4] = (struct block){scene->window_address, VIEW_WINDOW, scene->scene_bits + scene->more_grid_bits > 42 ? 8 : 7};
    int count = scene->environment_address == 0 ? 3 : scene->window == WINDOW_CONSTANT ? 4 : 5;
    if (scene->gather_address != 0)
        blocks[count++] = (struct block){scene->gather_address, VIEW_GATHER, COLONNADE_VIEW_GATHER};
    return count;
}

enum colonnade_error colonnade_view_open(struct colonnade_view *view, const struct colonnade_design *design,
                                         const void *data, size_t bytes) {
    const size_t words = bytes / 4;
    enum colonnade_error error =
        colonnade_check_header(design, data, bytes, 4 * FIXED_WORDS, "CLNDVIEW", VERSION, COLONNADE_NOT_A_VIEW);
    if (error != COLONNADE_OK) return error;
    if (bytes % 4 != 0) return COLONNADE_TRUNCATED;
    struct reader reader = {data, HEADER_WORDS};
    struct colonnade_view found = {.is_known = false};
    struct colonnade_view_scene *scene = &found.scene;
    const bool is_good = read_numbers(&reader, scene);
    scene->lights = read_word(&reader);
    scene->constants = read_word(&reader);
    if (!is_good || scene->lights > COLONNADE_VIEW_LIGHTS || !read_mesh(&reader, scene)) return COLONNADE_NOT_A_VIEW;

    struct colonnade_pose object;
    struct colonnade_camera camera;
    read_pose(&reader, &object);
    read_pose(&reader, &camera.pose);
    camera.fx = (int64_t)read_wide(&reader);
    camera.fy = (int64_t)read_wide(&reader);
    camera.cx = (int64_t)read_wide(&reader);
    camera.cy = (int64_t)read_wide(&reader);
    camera.width = read_word(&reader);
    camera.height = read_word(&reader);
    const bool has_room = scene->environment_address != 0;
    if (words - reader.next < LIGHT_WORDS * scene->lights + (has_room ? ROOM_WORDS : 0)) return COLONNADE_TRUNCATED;
    struct colonnade_light lights[COLONNADE_VIEW_LIGHTS];
    for (uint32_t i = 0; i < scene->lights; ++i) {
        read_vector(&reader, lights[i].position);
        for (int channel = 0; channel < 3; ++channel) lights[i].colour[channel] = read_word(&reader);
        lights[i].reach = read_wide(&reader);
    }
    size_t tiles = 0;
    if (has_room) {
        found.is_map_camera = read_word(&reader) != 0;
        if (!read_room(&reader, scene)) return COLONNADE_NOT_A_VIEW;
        if (!is_pose(&scene->map_pose)) return COLONNADE_BAD_POSE;
        tiles = (size_t)scene->tile_columns * scene->tile_rows;
    }
    const size_t left = words - reader.next;
    if (tiles > left / TILE_WORDS || scene->constants != (left - TILE_WORDS * tiles) / 2 || left % 2 != 0)
        return COLONNADE_TRUNCATED;
    scene->tiles = reader.bytes + 4 * reader.next;
    scene->writes = scene->tiles + 4 * TILE_WORDS * tiles;

    struct block blocks[MAX_BLOCKS];
    const int block_count = find_blocks(scene, blocks);
    for (int i = 0; i < block_count; ++i)
        if (!colonnade_are_frame_registers(design, blocks[i].address, blocks[i].count)) return COLONNADE_BAD_REGISTER;
    for (size_t i = 0; i < scene->constants; ++i)
        if (!colonnade_are_frame_registers(design, colonnade_word(scene->writes, 2 * i), 1)) return COLONNADE_BAD_REGISTER;

    error = check_camera(scene, &camera);
    found.camera = camera;
    if (error == COLONNADE_OK) error = colonnade_view_set_object(&found, &object);
    for (uint32_t i = 0; error == COLONNADE_OK && i < scene->lights; ++i)
        error = colonnade_view_set_light(&found, i, &lights[i]);
    if (error == COLONNADE_OK) error = colonnade_view_set_sample(&found, 0, 1);
    if (error == COLONNADE_OK) *view = found;
    return error;
}

enum colonnade_error colonnade_rotation(int32_t rotation[3][3], const int32_t quaternion[4]) {
    int64_t norm = 0;
    const int64_t one = (int64_t)1 << ROTATION_BITS;
    for (int i = 0; i < 4; ++i) {
        if (!is_within(quaternion[i], -one - 1024, one + 1024)) return COLONNADE_BAD_POSE;
        norm += (int64_t)quaternion[i] * quaternion[i];
    }
    norm = colonnade_nearest(norm, ROTATION_BITS);
    if (!is_within(norm, one - 1024, one + 1024)) return COLONNADE_BAD_POSE;
    /* Twice the products, over the norm: 1 / norm is 2 - norm but for the square of its small error */
    int32_t twice[3][4];
    for (int i = 0; i < 3; ++i)
        for (int j = i; j < 4; ++j) {
            const int64_t product = colonnade_nearest((int64_t)quaternion[i] * quaternion[j], ROTATION_BITS - 1);
            twice[i][j] = (int32_t)colonnade_nearest(product * (2 * one - norm), ROTATION_BITS);
            if (j < 3) twice[j][i] = twice[i][j];
        }
    for (int axis = 0; axis < 3; ++axis) {
        const int b = (axis + 1) % 3, c = (axis + 2) % 3;
        rotation[axis][axis] = (int32_t)(one - twice[b][b] - (int64_t)twice[c][c]);
        rotation[b][axis] = (int32_t)((int64_t)twice[axis][b] + twice[c][3]);
        rotation[axis][b] = (int32_t)((int64_t)twice[axis][b] - twice[c][3]);
    }
    return COLONNADE_OK;
}

enum colonnade_error colonnade_view_set_camera(struct colonnade_view *view, const struct colonnade_camera *camera) {
    const enum colonnade_error error = check_camera(&view->scene, camera);
    if (error != COLONNADE_OK) return error;
    view->camera = *camera;
    view->is_map_camera = false;
    return COLONNADE_OK;
}

enum colonnade_error colonnade_view_set_object(struct colonnade_view *view, const struct colonnade_pose *object) {
    if (!is_pose(object)) return COLONNADE_BAD_POSE;
    view->object = *object;
    return COLONNADE_OK;
}

enum colonnade_error colonnade_view_set_light(struct colonnade_view *view, uint32_t index,
                                              const struct colonnade_light *light) {
    if (index >= view->scene.lights) return COLONNADE_NO_LIGHT;
    if (!is_place(light->position)) return COLONNADE_BAD_POSE;
    view->lights[index] = *light;
    return COLONNADE_OK;
}

/* A point of the world on the object's grid, 2^-16 steps. Answers whether it is in the hardware's range. */
static bool find_on_grid(const struct colonnade_view *view, const int64_t point[3], int64_t steps[3]) {
    const int64_t limit = (int64_t)1 << 61, reach = ((int64_t)1 << (view->scene.scene_bits - 1)) - 1;
    int64_t from[3];
    for (int axis = 0; axis < 3; ++axis) from[axis] = point[axis] - view->object.position[axis];
    for (int axis = 0; axis < 3; ++axis) {
        int64_t high = 0, low = 0;
        for (int row = 0; row < 3; ++row) {
            const int64_t factor = view->object.rotation[row][axis];
            high += factor * (int32_t)(from[row] >> 31);
            low += factor * (int32_t)(from[row] & INT32_MAX);
        }
        const int64_t along = 2 * high + colonnade_nearest(low, ROTATION_BITS);
        steps[axis] = colonnade_scaled(along, &view->scene.steps, 16, limit) - view->scene.offset[axis];
        if (!is_within(steps[axis], -(reach << 16) + 1, (reach << 16) - 1)) return false;
    }
    return true;
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

/* The scaled rays of a picture, as whole numbers: those of the registers. */
struct rays {
    int32_t first[3], step_x[3], step_y[3];
    int shift; /* of `first` */
};

/* Directions times fx * fy need no division: (x + 1/2 - cx) * fy * right + (y + 1/2 - cy) * fx * down + fx * fy * forward;
 * the sample's shift moves the centre of a pixel.
 * One division scales them, so that the largest component in the frame is 2^(macBits - 2). */
static void set_directions(struct colonnade_view *view, const struct colonnade_work *work, struct rays *rays) {
    const struct colonnade_view_scene *scene = &view->scene;
    const struct colonnade_camera *camera = &view->camera;
    const int bits = scene->mac_bits;
    const int64_t to_x = COLONNADE_PIXEL / 2 + view->sample.shift[0] - camera->cx;
    const int64_t to_y = COLONNADE_PIXEL / 2 + view->sample.shift[1] - camera->cy;
    const int up = 62 - colonnade_bit_length((uint64_t)camera->fx | (uint64_t)camera->fy | colonnade_magnitude(to_x) |
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
    /* Steps larger than the directions, in a frame of few pixels, are scaled to their largest value, 2^(bits - 1) - 2 */
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
        for (int axis = 0; axis < 3; ++axis)
            to = colonnade_set_mac(scene, to, results[i][axis], scene->more_mac_bits);
    *to = (uint32_t)rays->shift;
}

/* The object's padded box, relative to the eye, rounded outwards to 30 bits. */
struct box {
    int32_t planes[3][2];
};

static void find_box(struct colonnade_view *view, const struct colonnade_work *work, struct box *box) {
    const struct colonnade_view_scene *scene = &view->scene;
    const int shift = work->unit_shift, fraction = scene->grid_fraction;
    const int64_t pad = ((int64_t)1 << scene->box_pad_log) + 1;
    int64_t planes[3][2];
    uint64_t most = 0;
    for (int axis = 0; axis < 3; ++axis) {
        /* The device's eye is that of the registers */
        const int64_t eye = colonnade_shift_left(colonnade_nearest(work->eye[axis], 16 + shift), shift);
        const int64_t low = scene->low[axis] - pad, high = scene->high[axis] + pad;
        planes[axis][0] = (fraction < 0 ? colonnade_floor(low, -fraction) : colonnade_shift_left(low, fraction)) - eye;
        planes[axis][1] = (fraction < 0 ? -colonnade_floor(-high, -fraction) : colonnade_shift_left(high, fraction)) - eye;
        most |= colonnade_magnitude(planes[axis][0]) | colonnade_magnitude(planes[axis][1]);
    }
    int down = colonnade_bit_length(most) - 29;
    if (down < 0) down = 0;
    for (int axis = 0; axis < 3; ++axis) {
        box->planes[axis][0] = (int32_t)colonnade_floor(planes[axis][0], down);
        box->planes[axis][1] = (int32_t)-colonnade_floor(-planes[axis][1], down);
    }
}

/* The half-plane of the pixels whose rays lie on one side of a plane through the eye: normal * ray >= 0. The normal has no
 * component along an axis. Answers whether it cuts the frame. */
static bool find_half_plane(const struct colonnade_view *view, const struct rays *rays, const int32_t normal[3], int axis,
                            int32_t half_plane[3]) {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    const int32_t *step_x = rays->step_x, *step_y = rays->step_y, *direction = rays->first;
    const int64_t x = (int64_t)normal[b] * step_x[b] + (int64_t)normal[c] * step_x[c];
    const int64_t y = (int64_t)normal[b] * step_y[b] + (int64_t)normal[c] * step_y[c];
    const int64_t first = (int64_t)normal[b] * direction[b] + (int64_t)normal[c] * direction[c];
    const uint64_t size_x = colonnade_magnitude(x), size_y = colonnade_magnitude(y);
    const uint64_t most = size_x > size_y ? size_x : size_y;
    const int64_t limit = ((int64_t)1 << (12 + view->scene.coordinate_bits)) - 1;
    half_plane[0] = half_plane[1] = 0;
    half_plane[2] = (int32_t)-limit;
    if (most == 0) return first < 0;
    /* Any common factor will do: its error is none of the half-plane's */
    const int down = colonnade_bit_length(most) - 31;
    const int64_t near_x = colonnade_nearest(x, down), near_y = colonnade_nearest(y, down);
    const uint32_t larger = (uint32_t)colonnade_magnitude(size_x > size_y ? near_x : near_y);
    const int64_t factor = ((uint32_t)OUTLINE_NORMAL << 20) / ((larger >> 12) + 1);
    half_plane[0] = (int32_t)colonnade_nearest(near_x * factor, 32);
    half_plane[1] = (int32_t)colonnade_nearest(near_y * factor, 32);
    const int up = rays->shift - down;
    int64_t offset = first < 0 ? -limit : limit;
    if (colonnade_bit_length(colonnade_magnitude(first)) + up <= 48) {
        const int64_t scaled = up >= 0 ? colonnade_shift_left(first, up) : -colonnade_floor(-first, -up);
        offset = -colonnade_floor(-scaled * factor, 32);
    }
    /* The rounded normal, and a pixel for the device's rounding */
    offset += ((int64_t)view->camera.width + view->camera.height) / 2 + 2 + OUTLINE_NORMAL;
    if (offset >= limit) return false;
    if (offset > -limit) half_plane[2] = (int32_t)offset;
    return true;
}

/* Planes through the eye and the edges between a face of the box that faces the eye and one that does not: four or six,
 * none if the eye is in the box. They also hold where the box reaches behind the camera. */
static void set_outline(struct colonnade_view *view, const struct rays *rays, const struct box *box) {
    uint32_t *words = colonnade_computed(view) + VIEW_OUTLINE;
    for (int i = 0; i < 3 * COLONNADE_VIEW_EDGES; ++i) words[i] = 0;
    bool faces[3][2];
    for (int axis = 0; axis < 3; ++axis) {
        faces[axis][0] = box->planes[axis][0] > 0;
        faces[axis][1] = box->planes[axis][1] < 0;
    }
    int used = 0;
    for (int edge = 0; edge < 12 && used < COLONNADE_VIEW_EDGES; ++edge) {
        const int axis = edge / 4, b = (axis + 1) % 3, c = (axis + 2) % 3, at_b = edge & 1, at_c = edge >> 1 & 1;
        if (faces[b][at_b] == faces[c][at_c]) continue;
        /* The plane through the eye and an edge along the axis; the opposite edge is inside */
        int32_t normal[3], half_plane[3];
        normal[axis] = 0;
        normal[b] = box->planes[c][at_c];
        normal[c] = -box->planes[b][at_b];
        if ((int64_t)normal[b] * box->planes[b][!at_b] + (int64_t)normal[c] * box->planes[c][!at_c] < 0)
            normal[b] = -normal[b], normal[c] = -normal[c];
        if (!find_half_plane(view, rays, normal, axis, half_plane)) continue;
        words[3 * used] = colonnade_bits(half_plane[0], 12);
        words[3 * used + 1] = colonnade_bits(half_plane[1], 12);
        words[3 * used + 2] = colonnade_bits(half_plane[2], 13 + view->scene.coordinate_bits);
        ++used;
    }
}

static void find_cross(const int32_t a[3], const int32_t b[3], int64_t cross[3]) {
    for (int axis = 0; axis < 3; ++axis) {
        const int next = (axis + 1) % 3, last = (axis + 2) % 3;
        cross[axis] = (int64_t)a[next] * b[last] - (int64_t)a[last] * b[next];
    }
}

static uint32_t clip(int64_t pixel, uint32_t size) {
    if (pixel < 0) return 0;
    return pixel > (int64_t)size ? size : (uint32_t)pixel;
}

/* The pixels around the corners of the box, a pixel wider; the whole frame if the box reaches behind the camera, none if it
 * lies there. A corner is at x = (step_y x first) * corner / d, y = (first x step_x) * corner / d with d = (step_x x step_y)
 * * corner. */
static void set_rectangle(struct colonnade_view *view, const struct rays *rays, const struct box *box) {
    const uint32_t size[2] = {view->camera.width, view->camera.height};
    const int up = 31 - view->scene.mac_bits;
    int32_t first[3], step_x[3], step_y[3];
    int64_t normals[3][3];
    for (int axis = 0; axis < 3; ++axis) { /* up to 2^30 */
        first[axis] = (int32_t)colonnade_nearest(rays->first[axis], -up);
        step_x[axis] = (int32_t)colonnade_nearest(rays->step_x[axis], -up);
        step_y[axis] = (int32_t)colonnade_nearest(rays->step_y[axis], -up);
    }
    find_cross(step_y, first, normals[0]);
    find_cross(first, step_x, normals[1]);
    find_cross(step_x, step_y, normals[2]);
    const int length_x = colonnade_block_length(normals[0]), length_y = colonnade_block_length(normals[1]);
    const int exponent = (length_x > length_y ? length_x : length_y) - 30;
    const int depth_exponent = colonnade_block_length(normals[2]) - 30;
    int64_t terms[3][3][2];
    for (int i = 0; i < 3; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            const int32_t normal = (int32_t)colonnade_nearest(normals[i][axis], i < 2 ? exponent : depth_exponent);
            for (int side = 0; side < 2; ++side) terms[i][axis][side] = (int64_t)normal * box->planes[axis][side];
        }
    struct colonnade_extent extent = {.is_empty = true};
    bool is_before = true, is_behind = true;
    for (int corner = 0; corner < 8; ++corner) {
        int64_t point[3];
        for (int i = 0; i < 3; ++i)
            point[i] = terms[i][0][corner & 1] + terms[i][1][corner >> 1 & 1] + terms[i][2][corner >> 2];
        is_behind = is_behind && point[2] < -((int64_t)1 << 40);
        is_before = is_before && colonnade_include(&extent, point);
    }
    const int power = exponent - depth_exponent + rays->shift;
    uint32_t *words = colonnade_computed(view) + VIEW_RECT;
    for (int i = 0; i < 2; ++i) {
        words[i] = is_before ? clip((int64_t)colonnade_whole(extent.low[i], power) - 1, size[i]) : 0;
        words[2 + i] = is_before ? clip((int64_t)colonnade_whole(extent.high[i], power) + 3, size[i]) : size[i];
    }
    if (is_behind || words[0] >= words[2] || words[1] >= words[3])
        for (int i = 0; i < 4; ++i) words[i] = 0;
}

bool colonnade_find_sight(const struct colonnade_view *view, const struct colonnade_pose *pose, struct colonnade_work *work) {
    for (int i = 0; i < 3; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            work->axes[i][axis] = 0;
            for (int row = 0; row < 3; ++row)
                work->axes[i][axis] += (int64_t)pose->rotation[row][i] * view->object.rotation[row][axis];
        }
    return find_on_grid(view, pose->position, work->eye);
}

static enum colonnade_error compute(struct colonnade_view *view) {
    const struct colonnade_view_scene *scene = &view->scene;
    struct colonnade_work work;
    if (!colonnade_find_sight(view, &view->camera.pose, &work)) return COLONNADE_TOO_FAR;
    for (uint32_t i = 0; i < scene->lights; ++i)
        if (!find_on_grid(view, view->lights[i].position, work.lights[i])) return COLONNADE_TOO_FAR;
    colonnade_computed(view)[VIEW_FRAME] = view->camera.width;
    colonnade_computed(view)[VIEW_FRAME + 1] = view->camera.height;
    set_positions(view, &work);
    for (uint32_t i = 0; i < scene->lights; ++i) set_light(view, i);
    for (int i = 0; scene->gather_address != 0 && i < COLONNADE_VIEW_GATHER; ++i)
        colonnade_computed(view)[VIEW_GATHER + i] = view->sample.points[i / 2][i % 2];
    struct rays rays;
    struct box box;
    set_directions(view, &work, &rays);
    find_box(view, &work, &box);
    set_outline(view, &rays, &box);
    set_rectangle(view, &rays, &box);
    return scene->environment_address == 0 ? COLONNADE_OK : colonnade_view_room(view, &work);
}

uint32_t colonnade_view_most_writes(const struct colonnade_view *view) {
    struct block blocks[MAX_BLOCKS];
    const int count = find_blocks(&view->scene, blocks);
    uint32_t most = view->scene.constants;
    for (int i = 0; i < count; ++i) most += blocks[i].count;
    return most;
}

static void write_word(uint8_t *bytes, uint32_t value) {
    bytes[0] = (uint8_t)value;
    bytes[1] = (uint8_t)(value >> 8);
    bytes[2] = (uint8_t)(value >> 16);
    bytes[3] = (uint8_t)(value >> 24);
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
    struct block blocks[MAX_BLOCKS];
    const int used = find_blocks(&view->scene, blocks);
    for (int i = 0; i < used; ++i) {
        const struct block block = blocks[i];
        for (uint32_t word = 0; word < block.count; ++word) {
            const uint32_t value = words[block.place + word];
            if (is_known && value == accepted[block.place + word]) continue;
            write_word(to, block.address + word);
            write_word(to + 4, value);
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
