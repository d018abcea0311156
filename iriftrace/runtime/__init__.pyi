from .doctor import diagnose as diagnose
from .llvm import llvm_libraries as llvm_libraries
from .variant import VARIANTS as VARIANTS
from .variant import ensure as ensure
from .variant import using as using
