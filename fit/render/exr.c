#include "fit/render/exr.h"

#include <OpenEXR/openexr.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int fail(enum err_code code, const char *path, exr_result_t result, struct err *e) {
    return err_set(e, result == EXR_ERR_OUT_OF_MEMORY ? ERR_NOMEM : code, "%s: %s", path,
                   exr_get_default_error_message(result));
}

static void quiet(exr_const_context_t file, exr_result_t code, const char *text) {
    (void)file;
    (void)code;
    (void)text;
}

static exr_result_t describe(exr_context_t file, const struct exr_form *form) {
    int part;
    exr_result_t result = exr_add_part(file, "picture", EXR_STORAGE_SCANLINE, &part);
    if (result == EXR_ERR_SUCCESS) {
        result =
            exr_initialize_required_attr_simple(file, part, form->width, form->height, EXR_COMPRESSION_ZIP);
    }
    for (int i = 0; i < form->n_channels && result == EXR_ERR_SUCCESS; i++) {
        result =
            exr_add_channel(file, part, form->channel[i], EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LINEAR, 1, 1);
    }
    for (int i = 0; i < form->n_texts && result == EXR_ERR_SUCCESS; i++) {
        result = exr_attr_set_string(file, part, form->text[i].name, form->text[i].value);
    }
    return result == EXR_ERR_SUCCESS ? exr_write_header(file) : result;
}

static int index_of(const struct exr_form *form, const char *name) {
    int i = 0;
    while (i < form->n_channels && strcmp(form->channel[i], name) != 0) {
        i++;
    }
    return i;
}

/* block[channel * lines * width + line * width + x]: the lines of one chunk. */
static void fill_block(const struct exr_form *form, int first, int lines, int rows, float *block) {
    float *row[EXR_CHANNELS_MAX];
    for (int line = 0; line < rows; line++) {
        for (int i = 0; i < form->n_channels; i++) {
            row[i] = block + ((size_t)i * (size_t)lines + (size_t)line) * (size_t)form->width;
        }
        form->fill(form->arg, first + line, row);
    }
}

/* EXR sorts the channels by name: each is found again by it. */
static void point_at(exr_encode_pipeline_t *encode, const struct exr_form *form, int lines, float *block) {
    for (int i = 0; i < encode->channel_count; i++) {
        exr_coding_channel_info_t *c = &encode->channels[i];
        size_t at = (size_t)index_of(form, c->channel_name) * (size_t)lines * (size_t)form->width;
        c->encode_from_ptr = (const uint8_t *)(block + at);
        c->user_pixel_stride = sizeof *block;
        c->user_line_stride = (int32_t)((size_t)form->width * sizeof *block);
        c->user_bytes_per_element = sizeof *block;
        c->user_data_type = EXR_PIXEL_FLOAT;
    }
}

static exr_result_t write_block(exr_context_t file, const struct exr_form *form, int first, int lines,
                                exr_encode_pipeline_t *encode, float *block) {
    exr_chunk_info_t chunk;
    int rows = form->height - first < lines ? form->height - first : lines;
    bool fresh = first == 0;
    exr_result_t result = exr_write_scanline_chunk_info(file, 0, first, &chunk);
    if (result == EXR_ERR_SUCCESS) {
        result = fresh ? exr_encoding_initialize(file, 0, &chunk, encode)
                       : exr_encoding_update(file, 0, &chunk, encode);
    }
    if (result == EXR_ERR_SUCCESS) {
        fill_block(form, first, lines, rows, block);
        point_at(encode, form, lines, block);
        result = fresh ? exr_encoding_choose_default_routines(file, 0, encode) : EXR_ERR_SUCCESS;
    }
    return result == EXR_ERR_SUCCESS ? exr_encoding_run(file, 0, encode) : result;
}

static exr_result_t write_blocks(exr_context_t file, const struct exr_form *form) {
    exr_encode_pipeline_t encode = EXR_ENCODE_PIPELINE_INITIALIZER;
    int32_t lines = 0;
    exr_result_t result = exr_get_scanlines_per_chunk(file, 0, &lines);
    float *block = malloc((size_t)form->n_channels * (size_t)lines * (size_t)form->width * sizeof *block);
    result = block ? result : EXR_ERR_OUT_OF_MEMORY;
    for (int first = 0; first < form->height && result == EXR_ERR_SUCCESS; first += lines) {
        result = write_block(file, form, first, lines, &encode, block);
    }
    exr_encoding_destroy(file, &encode);
    free(block);
    return result;
}

/* Writes to a temporary name beside it, so that the file appears whole or not at all. */
int exr_save(const char *path, const struct exr_form *form, struct err *e) {
    exr_context_t file;
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = quiet;
    exr_result_t result = exr_start_write(&file, path, EXR_INTERMEDIATE_TEMP_FILE, &setup);
    if (result != EXR_ERR_SUCCESS) {
        return fail(ERR_IO, path, result, e);
    }
    exr_set_longname_support(file, 1);
    result = describe(file, form);
    result = result == EXR_ERR_SUCCESS ? write_blocks(file, form) : result;
    exr_result_t closed = exr_finish(&file);
    result = result == EXR_ERR_SUCCESS ? closed : result;
    return result == EXR_ERR_SUCCESS ? 0 : fail(ERR_IO, path, result, e);
}

static int take_form(exr_context_t file, const char *path, struct exr_image *image, struct err *e) {
    exr_attr_box2i_t window;
    const exr_attr_chlist_t *channels;
    exr_storage_t storage;
    bool good = exr_get_data_window(file, 0, &window) == EXR_ERR_SUCCESS &&
                exr_get_channels(file, 0, &channels) == EXR_ERR_SUCCESS &&
                exr_get_storage(file, 0, &storage) == EXR_ERR_SUCCESS && storage == EXR_STORAGE_SCANLINE &&
                window.min.x == 0 && window.min.y == 0 && channels->num_channels <= EXR_CHANNELS_MAX;
    if (!good) {
        return err_set(e, ERR_INPUT, "%s is not laid out as goniorender writes its files", path);
    }
    image->width = window.max.x + 1;
    image->height = window.max.y + 1;
    if ((long long)image->width * image->height * channels->num_channels > EXR_VALUES_MAX) {
        return err_set(e, ERR_INPUT, "%s holds %d x %d pixels of %d channels: too many", path, image->width,
                       image->height, channels->num_channels);
    }
    for (int i = 0; i < channels->num_channels; i++) {
        snprintf(image->channel[i], EXR_NAME_MAX, "%s", channels->entries[i].name.str);
        image->plane[i] = malloc((size_t)image->width * (size_t)image->height * sizeof(float));
        image->n_channels++;
        if (!image->plane[i]) {
            return err_set(e, ERR_NOMEM, "no memory for %s", path);
        }
    }
    return 0;
}

static void point_into(exr_decode_pipeline_t *decode, struct exr_image *image, int first) {
    for (int i = 0; i < decode->channel_count; i++) {
        exr_coding_channel_info_t *c = &decode->channels[i];
        c->decode_to_ptr = (uint8_t *)(image->plane[i] + (size_t)first * (size_t)image->width);
        c->user_pixel_stride = sizeof(float);
        c->user_line_stride = (int32_t)((size_t)image->width * sizeof(float));
        c->user_bytes_per_element = sizeof(float);
        c->user_data_type = EXR_PIXEL_FLOAT;
    }
}

static exr_result_t read_blocks(exr_context_t file, struct exr_image *image) {
    exr_decode_pipeline_t decode = EXR_DECODE_PIPELINE_INITIALIZER;
    int32_t lines = 0;
    exr_result_t result = exr_get_scanlines_per_chunk(file, 0, &lines);
    for (int first = 0; first < image->height && result == EXR_ERR_SUCCESS; first += lines) {
        exr_chunk_info_t chunk;
        bool fresh = first == 0;
        result = exr_read_scanline_chunk_info(file, 0, first, &chunk);
        if (result == EXR_ERR_SUCCESS) {
            result = fresh ? exr_decoding_initialize(file, 0, &chunk, &decode)
                           : exr_decoding_update(file, 0, &chunk, &decode);
        }
        if (result == EXR_ERR_SUCCESS) {
            point_into(&decode, image, first);
            result = fresh ? exr_decoding_choose_default_routines(file, 0, &decode) : EXR_ERR_SUCCESS;
        }
        result = result == EXR_ERR_SUCCESS ? exr_decoding_run(file, 0, &decode) : result;
    }
    exr_decoding_destroy(file, &decode);
    return result;
}

static int take_text(exr_context_t file, const char *name, struct exr_image *image, struct err *e) {
    const char *text;
    int32_t length;
    if (exr_attr_get_string(file, 0, name, &length, &text) != EXR_ERR_SUCCESS) {
        return 0;
    }
    image->text = strndup(text, (size_t)length);
    return image->text ? 0 : err_set(e, ERR_NOMEM, "no memory for the text of an EXR");
}

int exr_load(const char *path, const char *text_name, struct exr_image *image, struct err *e) {
    exr_context_t file;
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = quiet;
    *image = (struct exr_image){0};
    exr_result_t result = exr_start_read(&file, path, &setup);
    if (result != EXR_ERR_SUCCESS) {
        return fail(result == EXR_ERR_FILE_ACCESS ? ERR_IO : ERR_INPUT, path, result, e);
    }
    int status = take_form(file, path, image, e);
    status = status ? status : take_text(file, text_name, image, e);
    result = status ? EXR_ERR_SUCCESS : read_blocks(file, image);
    exr_finish(&file);
    status = result == EXR_ERR_SUCCESS ? status : fail(ERR_INPUT, path, result, e);
    if (status) {
        exr_free(image);
    }
    return status;
}

void exr_free(struct exr_image *image) {
    for (int i = 0; i < image->n_channels; i++) {
        free(image->plane[i]);
    }
    free(image->text);
    *image = (struct exr_image){0};
}

const float *exr_plane(const struct exr_image *image, const char *channel) {
    for (int i = 0; i < image->n_channels; i++) {
        if (strcmp(image->channel[i], channel) == 0) {
            return image->plane[i];
        }
    }
    return NULL;
}
