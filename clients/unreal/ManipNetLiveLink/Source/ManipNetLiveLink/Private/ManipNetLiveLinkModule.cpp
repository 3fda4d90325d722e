#include "Modules/ModuleManager.h"

// Live Link finds the factory by its class: there is nothing to set up.
IMPLEMENT_MODULE(FDefaultModuleImpl, ManipNetLiveLink)
