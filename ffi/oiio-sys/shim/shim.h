// C interface to the part of OpenImageIO that gsii uses. Mirrored by src/lib.rs.
//
// Every function that can fail returns 0 for success and writes a NUL-terminated reason to `error`
// (at most `error_size` bytes, cut if longer) otherwise. No C++ exception leaves a function.

#pragma once
#include <cstddef>
#include <cstdint>

extern "C" {

struct GsiiReader;

enum GsiiSample { GSII_U8 = 0, GSII_HALF = 1, GSII_F32 = 2 };
enum GsiiKind { GSII_INT = 0, GSII_FLOAT = 1, GSII_STRING = 2 };

// Decoded images above this size are refused.
enum { GSII_IMAGE_MEGABYTES = 2048 };

struct GsiiInfo {
    int32_t width, height, depth;
    int32_t channels;
    int32_t alpha_channel;   // -1: none
    int32_t bytes_per_value; // of the widest channel as stored
    int32_t floating_point;  // 1 if the file stores float, half or double
    int32_t deep;            // 1 if pixels are lists of samples
    int32_t attributes;
};

struct GsiiAttribute {
    const char* name;
    const char* text; // GSII_STRING
    double real;      // GSII_FLOAT
    int32_t kind;
    int32_t integer; // GSII_INT
};

struct GsiiImage {
    const char* path;
    const void* values;          // width * height * channels, interleaved, uint8_t or float
    const char* const* names;    // of the channels
    const uint8_t* stored_as;    // GsiiSample per channel
    const GsiiAttribute* attributes;
    const char* compression;     // or null
    size_t attribute_count;
    int32_t width, height, channels;
    int32_t values_are;          // GSII_U8 or GSII_F32
    int32_t tile;                // edge of square tiles where the format has them, 0 for rows
    int32_t reserved;
};

// Version that the shim was compiled with, and that of the library that is loaded: 10000 major + 100 minor + patch.
int gsii_oiio_compiled_version(void);
int gsii_oiio_library_version(void);

// Threads that OpenImageIO and OpenEXR may use; 0: as many as the machine has.
int gsii_oiio_set_threads(int threads, char* error, size_t error_size);

// Comma-separated extensions of the formats that can be written to.
int gsii_oiio_writable(char* list, size_t list_size, char* error, size_t error_size);

// Opens a file, or `size` bytes at `memory` that must stay there until gsii_oiio_close.
GsiiReader* gsii_oiio_open(const char* path, const void* memory, size_t size, GsiiInfo* info, char* error,
                           size_t error_size);
// Both pointers stay valid until gsii_oiio_close. Null if there is no such channel or attribute.
const char* gsii_oiio_channel(const GsiiReader* reader, int index);
int gsii_oiio_attribute(const GsiiReader* reader, int index, GsiiAttribute* attribute);
// Reads channels 0..channels to `values` (capacity in bytes), `pixel_stride` bytes from pixel to pixel, no row padding.
int gsii_oiio_read(GsiiReader* reader, int channels, int sample, void* values, size_t pixel_stride, size_t capacity,
                   char* error, size_t error_size);
void gsii_oiio_close(GsiiReader* reader);

// Writes a whole image, in the format that the extension of the path asks for.
int gsii_oiio_write(const GsiiImage* image, char* error, size_t error_size);

// Whether the format of this extension stores any number of named channels, each in a type of its own.
int gsii_oiio_named_channels(const char* path, int* answer, char* error, size_t error_size);
}
