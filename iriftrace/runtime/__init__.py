"""Which Mitsuba variant and which LLVM or CUDA library."""
