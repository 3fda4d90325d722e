#include "Modules/ModuleManager.h"

// Live Link finds the factory by its class, so the module has nothing to set up.
IMPLEMENT_MODULE(FDefaultModuleImpl, ManipNetLiveLink)
