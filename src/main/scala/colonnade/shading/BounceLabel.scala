package colonnade.shading

import colonnade.microcode.Label

/** Labels of [[BounceProgram]]. */
sealed trait BounceLabel extends Label

object BounceLabel {

  /** Waits for a hit. */
  case object Idle extends BounceLabel

  /** Normalises the geometric normal, which takes the place of the smooth one. */
  case object GeometricNormal extends BounceLabel

  /** Computes the lengths of normal and ray, and their angle. */
  case object DotProducts extends BounceLabel

  /** Computes the reflected direction. */
  case object Reflect extends BounceLabel

  /** Computes Snell's discriminant. */
  case object Discriminant extends BounceLabel

  /** Takes the discriminant's root. */
  case object Root extends BounceLabel

  /** Computes the refracted direction. */
  case object Refract extends BounceLabel

  /** Checks on which side of the surface the ray goes on. */
  case object HemisphereCheck extends BounceLabel

  /** Moves the origin to the other side of the surface. */
  case object Offset extends BounceLabel

  /** Computes the cosine for Schlick's approximation. */
  case object Cosine extends BounceLabel

  /** Computes Schlick's approximation of the Fresnel term. */
  case object Fresnel extends BounceLabel

  /** Offers the result. */
  case object Done extends BounceLabel
}
