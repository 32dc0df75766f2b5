#include "capture/mjpeg.hpp"

// The library's header needs FILE before it.
#include <cstdio>
// clang-format off
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

#include <csetjmp>

namespace groundline::capture {
namespace {

// Encoders pad a segment by a byte or two; what is left of a segment after lost data is more.
constexpr int kMostStrayBytes = 16;

}  // namespace

struct MjpegDecoder::Library {
    jpeg_decompress_struct decoder{};
    jpeg_error_mgr errors{};
    std::jmp_buf escape{};
    std::array<char, JMSG_LENGTH_MAX> problem{};

    static Library& of(j_common_ptr decoder) { return *static_cast<Library*>(decoder->client_data); }

    // The library's way out of an error: back to decode().
    [[noreturn]] static void fail(j_common_ptr decoder) {
        Library& library = of(decoder);
        decoder->err->format_message(decoder, library.problem.data());
        std::longjmp(library.escape, 1);
    }
    static void message(j_common_ptr decoder, int level) {
        if (level >= 0) return;  // not a warning
        const jpeg_error_mgr& errors = *decoder->err;
        if (errors.msg_code == JWRN_EXTRANEOUS_DATA && errors.msg_parm.i[0] <= kMostStrayBytes) return;
        fail(decoder);
    }

    // No object with a destructor may live in here: fail() jumps over them.
    bool decode(const std::uint8_t* bytes, std::size_t size, Luma into) {
        if (setjmp(escape) != 0) {
            jpeg_abort_decompress(&decoder);
            return false;
        }
        jpeg_mem_src(&decoder, bytes, static_cast<unsigned long>(size));
        jpeg_read_header(&decoder, TRUE);
        if (!into.same_size(static_cast<int>(decoder.image_width), static_cast<int>(decoder.image_height))) {
            std::snprintf(problem.data(), problem.size(), "it is %ux%u and not %dx%d", decoder.image_width,
                          decoder.image_height, into.width, into.height);
            jpeg_abort_decompress(&decoder);
            return false;
        }
        decoder.out_color_space = JCS_GRAYSCALE;
        decoder.dct_method = JDCT_ISLOW;
        jpeg_start_decompress(&decoder);
        while (decoder.output_scanline < decoder.output_height) {
            JSAMPROW row = into.row(static_cast<int>(decoder.output_scanline));
            jpeg_read_scanlines(&decoder, &row, 1);
        }
        jpeg_finish_decompress(&decoder);
        return true;
    }
};

MjpegDecoder::MjpegDecoder() : library_(std::make_unique<Library>()) {
    Library& library = *library_;
    library.decoder.err = jpeg_std_error(&library.errors);
    library.errors.error_exit = Library::fail;
    library.errors.emit_message = Library::message;
    jpeg_create_decompress(&library.decoder);
    library.decoder.client_data = &library;
}

MjpegDecoder::~MjpegDecoder() {
    jpeg_destroy_decompress(&library_->decoder);
}

bool MjpegDecoder::decode(std::span<const std::uint8_t> jpeg, Luma into) {
    return library_->decode(jpeg.data(), jpeg.size(), into);
}

const char* MjpegDecoder::problem() const {
    return library_->problem.data();
}

}  // namespace groundline::capture
