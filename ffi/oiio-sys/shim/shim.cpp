#include "shim.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#if OIIO_VERSION < OIIO_MAKE_VERSION(2, 4, 0)
#    error "OpenImageIO 2.4 or newer is needed"
#endif

// The Rust side declares these by hand.
static_assert(sizeof(void*) != 8
                  || (sizeof(GsiiInfo) == 36 && sizeof(GsiiAttribute) == 32 && sizeof(GsiiImage) == 80),
              "keep src/lib.rs in step");

using namespace OIIO;

struct GsiiReader {
    // Declared first, destroyed last: `input` reads through it.
    std::unique_ptr<Filesystem::IOMemReader> memory;
    ImageInput::unique_ptr input;
    ImageSpec spec;
    std::vector<std::string> texts;
};

namespace {

void report(char* error, size_t size, const char* reason)
{
    if (!error || size == 0)
        return;
    size_t length = std::min(std::strlen(reason), size - 1);
    std::memcpy(error, reason, length);
    error[length] = 0;
}

#if OIIO_VERSION >= OIIO_MAKE_VERSION(2, 5, 0)
const char* const linear_rec709 = "lin_rec709";
#else
const char* const linear_rec709 = "Linear";
#endif

// OpenImageIO keeps the reasons of failed opens per thread and those of later failures in the object.
template<typename T> [[noreturn]] void fail(const std::unique_ptr<T>& file, const char* otherwise)
{
    std::string reason = file ? file->geterror() : std::string();
    if (reason.empty())
        reason = OIIO::geterror();
    throw std::runtime_error(reason.empty() ? otherwise : reason);
}

template<typename F> int guarded(char* error, size_t size, F&& body) noexcept
{
    try {
        body();
        return 0;
    } catch (const std::bad_alloc&) {
        report(error, size, "out of memory");
    } catch (const std::exception& e) {
        report(error, size, e.what());
    } catch (...) {
        report(error, size, "OpenImageIO threw something that is not an exception");
    }
    return 1;
}

TypeDesc type_of(int sample)
{
    switch (sample) {
    case GSII_U8: return TypeDesc::UINT8;
    case GSII_HALF: return TypeDesc::HALF;
    case GSII_F32: return TypeDesc::FLOAT;
    }
    throw std::invalid_argument("unknown sample type");
}

size_t times(size_t a, size_t b)
{
    if (b != 0 && a > std::numeric_limits<size_t>::max() / b)
        throw std::length_error("the size of the image overflows");
    return a * b;
}

void write_bytes(const char* path, const std::vector<unsigned char>& bytes)
{
    FILE* file = Filesystem::fopen(path, "wb");
    if (!file)
        throw std::runtime_error(std::strerror(errno));
    errno = 0;
    bool written = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
    int reason = errno;
    // The rest of the buffer goes out here.
    bool closed = std::fclose(file) == 0;
    if (!written || !closed)
        throw std::runtime_error(std::strerror(written ? errno : reason));
}

bool floating(TypeDesc type) { return type.is_floating_point(); }

} // namespace

int gsii_oiio_compiled_version(void) { return OIIO_VERSION; }

int gsii_oiio_library_version(void) { return openimageio_version(); }

int gsii_oiio_set_threads(int threads, char* error, size_t error_size)
{
    return guarded(error, error_size, [&] {
        // OpenEXR has a pool of its own, for which 0 means all cores and -1 none.
        if (!OIIO::attribute("threads", threads) || !OIIO::attribute("exr_threads", threads == 1 ? -1 : threads))
            throw std::runtime_error("OpenImageIO does not take the number of threads");
    });
}

int gsii_oiio_writable(char* list, size_t list_size, char* error, size_t error_size)
{
    return guarded(error, error_size, [&] {
        std::string all;
        for (const auto& format : OIIO::get_extension_map()) {
            if (format.first == "null" || format.first == "term")
                continue; // these make no file
            for (const std::string& extension : format.second) {
                // The map also names what can only be read.
                if (auto output = ImageOutput::create("image." + extension))
                    all += (all.empty() ? "" : ",") + extension;
                else
                    (void)OIIO::geterror();
            }
        }
        if (all.size() >= list_size)
            throw std::length_error("the list of formats is too long");
        report(list, list_size, all.c_str());
    });
}

GsiiReader* gsii_oiio_open(const char* path, const void* memory, size_t size, GsiiInfo* info, char* error,
                           size_t error_size)
{
    std::unique_ptr<GsiiReader> reader;
    int failed = guarded(error, error_size, [&] {
        // For formats that decode while they open. Everything else is stopped by the caller's own check of `info`.
        static const bool limited = OIIO::attribute("limits:imagesize_MB", GSII_IMAGE_MEGABYTES);
        (void)limited;
        reader = std::make_unique<GsiiReader>();
        ImageSpec hints;
        // Colours stay as stored, not multiplied by alpha.
        hints.attribute("oiio:UnassociatedAlpha", 1);
        if (memory) {
            // Only by the name of a format is a reader made without opening a file: OpenImageIO 2.4 looks for a file
            // of the given name first and fails without it, whatever proxy it is given.
            const char* dot = std::strrchr(path, '.');
            reader->input = ImageInput::create(dot ? dot + 1 : path);
            if (!reader->input)
                fail(reader->input, "OpenImageIO knows no such format");
            if (!reader->input->supports("ioproxy"))
                throw std::runtime_error("this format is not read from memory");
            reader->memory = std::make_unique<Filesystem::IOMemReader>(memory, size);
            ImageSpec spec;
            if (!reader->input->set_ioproxy(reader->memory.get()) || !reader->input->open(path, spec, hints))
                fail(reader->input, "not an image that OpenImageIO can read");
        } else {
            reader->input = ImageInput::open(path, &hints);
            if (!reader->input)
                fail(reader->input, "not an image that OpenImageIO can read");
        }
        reader->spec = reader->input->spec();

        const ImageSpec& spec = reader->spec;
        *info = GsiiInfo();
        info->width = spec.width;
        info->height = spec.height;
        info->depth = spec.depth;
        info->channels = spec.nchannels;
        info->alpha_channel = spec.alpha_channel;
        info->bytes_per_value = int32_t(spec.format.size());
        info->floating_point = floating(spec.format);
        for (TypeDesc type : spec.channelformats) {
            info->bytes_per_value = std::max(info->bytes_per_value, int32_t(type.size()));
            info->floating_point |= floating(type);
        }
        info->deep = spec.deep;
        info->attributes = int32_t(spec.extra_attribs.size());
        for (const ParamValue& value : spec.extra_attribs)
            reader->texts.push_back(value.get_string());
    });
    return failed ? nullptr : reader.release();
}

const char* gsii_oiio_channel(const GsiiReader* reader, int index)
{
    if (index < 0 || size_t(index) >= reader->spec.channelnames.size())
        return nullptr;
    return reader->spec.channelnames[index].c_str();
}

int gsii_oiio_attribute(const GsiiReader* reader, int index, GsiiAttribute* attribute)
{
    if (index < 0 || size_t(index) >= reader->texts.size())
        return 1;
    const ParamValue& value = reader->spec.extra_attribs[index];
    *attribute = GsiiAttribute();
    attribute->name = value.name().c_str();
    attribute->kind = GSII_STRING;
    attribute->text = reader->texts[index].c_str();
    if (value.type() == TypeInt) {
        attribute->kind = GSII_INT;
        attribute->integer = value.get_int();
    } else if (value.type() == TypeFloat) {
        attribute->kind = GSII_FLOAT;
        attribute->real = value.get_float();
    }
    return 0;
}

int gsii_oiio_read(GsiiReader* reader, int channels, int sample, void* values, size_t pixel_stride, size_t capacity,
                   char* error, size_t error_size)
{
    return guarded(error, error_size, [&] {
        const ImageSpec& spec = reader->spec;
        TypeDesc type = type_of(sample);
        if (channels < 1 || channels > spec.nchannels || spec.width < 1 || spec.height < 1 || spec.depth > 1)
            throw std::invalid_argument("no such pixels in the file");
        if (pixel_stride < times(size_t(channels), type.size())
            || capacity < times(times(size_t(spec.width), size_t(spec.height)), pixel_stride))
            throw std::length_error("the buffer is too small for the image");
        if (!reader->input->read_image(0, 0, 0, channels, type, values, stride_t(pixel_stride),
                                       stride_t(pixel_stride) * spec.width))
            fail(reader->input, "the pixels cannot be read");
    });
}

void gsii_oiio_close(GsiiReader* reader)
{
    // A destructor that throws would end the process by itself; close() is called by ImageInput's.
    delete reader;
}

int gsii_oiio_write(const GsiiImage* image, char* error, size_t error_size)
{
    return guarded(error, error_size, [&] {
        const int channels = image->channels;
        Filesystem::IOVecOutput memory; // outlives `output`, which writes to it
        auto output = ImageOutput::create(image->path);
        if (!output)
            fail(output, "OpenImageIO knows no such format");
        ImageSpec spec(image->width, image->height, channels, type_of(image->stored_as[0]));
        spec.channelnames.assign(image->names, image->names + channels);
        // Nothing here has opacity, whatever a layer calls its channels.
        spec.alpha_channel = -1;
        for (size_t i = 0; i < image->attribute_count; ++i) {
            const GsiiAttribute& attribute = image->attributes[i];
            switch (attribute.kind) {
            case GSII_INT: spec.attribute(attribute.name, int(attribute.integer)); break;
            case GSII_FLOAT: spec.attribute(attribute.name, float(attribute.real)); break;
            case GSII_STRING: spec.attribute(attribute.name, string_view(attribute.text)); break;
            default: throw std::invalid_argument("unknown kind of attribute");
            }
        }
        spec.attribute("oiio:ColorSpace", image->values_are == GSII_U8 ? "sRGB" : linear_rec709);
        if (image->tile > 0 && output->supports("tiles"))
            spec.tile_width = spec.tile_height = image->tile;
        if (image->compression)
            spec.attribute("compression", string_view(image->compression));

        bool mixed = false;
        size_t pixel_bytes = 0;
        for (int c = 0; c < channels; ++c) {
            mixed |= image->stored_as[c] != image->stored_as[0];
            pixel_bytes += type_of(image->stored_as[c]).size();
        }
        TypeDesc given = type_of(image->values_are);
        std::vector<unsigned char> packed;
        if (mixed) {
            if (!output->supports("channelformats"))
                throw std::invalid_argument("the format stores all channels in one type");
            for (int c = 0; c < channels; ++c)
                spec.channelformats.push_back(type_of(image->stored_as[c]));
            // write_image() converts to one type only, so pixels of several types go in as they are stored.
            packed.resize(times(times(size_t(image->width), size_t(image->height)), pixel_bytes));
            const stride_t from = stride_t(channels) * stride_t(given.size()), to = stride_t(pixel_bytes);
            size_t offset = 0;
            for (int c = 0; c < channels; ++c) {
                const char* source = static_cast<const char*>(image->values) + size_t(c) * given.size();
                if (!convert_image(1, image->width, image->height, 1, source, given, from, from * image->width,
                                   AutoStride, packed.data() + offset, spec.channelformats[c], to, to * image->width,
                                   AutoStride))
                    fail(output, "the pixels cannot be converted");
                offset += spec.channelformats[c].size();
            }
        }
        // On a full disk OpenEXR and PNG report success and libjpeg ends the process (seen with 2.4.7), so the file is
        // made in memory where the format can do that.
        const bool in_memory = output->supports("ioproxy") && output->set_ioproxy(&memory);
        output->threads(OIIO::get_int_attribute("threads"));
        if (!output->open(image->path, spec))
            fail(output, "the file cannot be created");
        bool written = mixed ? output->write_image(TypeDesc::UNKNOWN, packed.data())
                             : output->write_image(given, image->values);
        if (!written)
            fail(output, "the pixels cannot be written");
        // Some formats write everything here.
        if (!output->close())
            fail(output, "the file cannot be completed");
        output.reset();
        if (in_memory) {
            write_bytes(image->path, memory.buffer());
            return;
        }
        // The other formats do not tell either; what cannot be read again was not written.
        auto input = ImageInput::open(image->path);
        std::vector<unsigned char> values;
        if (input)
            values.resize(times(input->spec().image_pixels(), input->spec().pixel_bytes(true)));
        if (!input || !input->read_image(0, 0, 0, input->spec().nchannels, TypeDesc::UNKNOWN, values.data()))
            fail(input, "the file that was written cannot be read");
    });
}

int gsii_oiio_named_channels(const char* path, int* answer, char* error, size_t error_size)
{
    return guarded(error, error_size, [&] {
        auto output = ImageOutput::create(path);
        if (!output)
            fail(output, "OpenImageIO knows no such format");
        *answer = !std::strcmp(output->format_name(), "openexr");
    });
}
