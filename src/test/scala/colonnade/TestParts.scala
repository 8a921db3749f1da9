package colonnade

import colonnade.config.{ColonnadeConfig, PathConfig, TraversalConfig}

import scala.language.implicitConversions

/** Lets a spec build a part of a column straight from a device's configuration; what any part may have has the contexts
  * of a traversal unit.
  */
object TestParts extends PathParts {
  implicit def ofTraversal(config: ColonnadeConfig): TraversalConfig = TraversalConfig(config)
}

sealed abstract class PathParts {
  implicit def ofPaths(config: ColonnadeConfig): PathConfig = PathConfig(config)
}
