package colonnade.shading

import chisel3._
import chisel3.util.log2Ceil
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{FrameRegisters, Rgb, Vec3}

/** A hit, or a point of the environment, in the [[ShadingPipeline]]. */
final class ShadingHit(config: PathConfig) extends Bundle {
  private val numbers = config.numbers

  val context       = Context(config)
  val material      = MaterialIndex(config)
  val isEnvironment = Bool()
  val isBounce      = Bool() // its material is a mirror or glass
  val isFlat        = Bool() // shade with the geometric normal
  val backSide      = Bool()

  /** The ray's dominant axis, and whether it goes down there. */
  val axis       = UInt(2.W)
  val isNegative = Bool()

  // In the ray's frame
  val origin   = Vec(3, SInt(ShaderFormats.originBits(config).W))
  val shear    = Vec(2, SInt(numbers.gridBits.W))
  val distance = SInt(numbers.gridBits.W)

  // In the object's frame
  val weights         = Vec(3, UInt(numbers.barycentricBits.W))
  val normals         = Vec(3, Vec3(SInt(NumberFormats.normalBits.W)))
  val geometricNormal = Vec3(SInt(NumberFormats.normalBits.W))

  val colours = Option.when(config.device.geometry.cornerColours)(Vec(3, Rgb(FrameRegisters.colour))) // by corner
}

/** What the end of the [[ShadingPipeline]] has to know of a light on a hit. */
final class LightSlot(config: PathConfig) extends Bundle {
  val light   = UInt(log2Ceil(config.device.frame.lights.max(2)).W)
  val isLast  = Bool()
  val shadows = Bool() // a shadow ray is needed if the surface faces the light
  val isOn    = Bool() // the light is on
}

/** Whether a surface is rough metal with a lobe, or a rough mirror or glass, and of which material. */
final class RoughSurface(config: PathConfig) extends Bundle {
  val isRough  = Bool()
  val material = MaterialIndex(config)
}

/** The number of a material, truncated to the bits that the table needs. */
object MaterialIndex {
  def apply(config: PathConfig): UInt = UInt(log2Ceil(config.device.frame.materials.max(2)).W)
}
