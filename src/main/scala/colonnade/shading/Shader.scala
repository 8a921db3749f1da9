package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled}
import colonnade.common.Context
import colonnade.config.{NumberFormats, PathConfig, UnitsConfig}
import colonnade.formats.{Face, FrameRegisters, Light, Material, Rgb, Shading, Vec3}
import colonnade.numbers.Fixed
import colonnade.ray.{RayFormats, TriangleRay}
import colonnade.traversal.HitPoint

/** Ports of [[Shader]]; the registers are constant while it is busy. */
final class ShaderIO(config: PathConfig) extends Bundle {
  private val numbers = config.numbers

  val lights    = Input(Vec(config.device.frame.lights, new Light(numbers)))
  val unitShift = Input(UInt(NumberFormats.bitLength(numbers.sceneBits).W))
  val shading   = Input(new Shading(config.device))
  val materials = Input(Vec(config.device.frame.materials, new Material(config.device)))
  val request   = Flipped(Decoupled(new ShadeRequest(config)))

  /** Points of the environment; taken when there is no request. */
  val environment = if (config.device.hasEnvironment) Some(Flipped(Decoupled(new EnvironmentSurface(config)))) else None

  val readyNext = Output(Bool()) // `request` is ready in the next cycle

  /** To the textures, and whether a texel was illegal. */
  val texture        = config.device.geometry.texture.map(_ => new TexturePort(config))
  val isIllegalTexel = config.device.geometry.texture.map(_ => Output(Bool()))

  /** A hit on a diffuse surface asks for its sample point. */
  val sample = Option.when(config.device.frame.gather)(new SamplePort(config))

  /** Hits on diffuse surfaces; those on mirrors and glass. */
  val lit     = Decoupled(new LitSurface(config))
  val bounced = Option.when(config.device.frame.hasBounces)(Decoupled(new BouncedRay(config)))

  val busy = Output(Bool()) // the entry holds a hit: a cycle of the narrowest stage
}

/** Shades hits: docs/numbers.md, 5 and 6. Lit surfaces leave in the order of their hits. */
abstract class Shader(config: PathConfig) extends Module {
  final val io = IO(new ShaderIO(config))

  /** A light's entry; a single light needs no index. */
  protected def at[T <: Data](entries: Vec[T], index: UInt): T =
    if (config.device.frame.lights == 1) entries.head else entries(index)
}

object Shader {

  /** The smallest unit that takes a light on a hit every `units.shadeInterval` cycles. */
  def apply(config: PathConfig): Shader =
    if (config.device.units.shadeInterval >= UnitsConfig.sequentialShadeInterval) new SequentialShader(config)
    else new ShadingPipeline(config)
}

/** A hit to shade. */
final class ShadeRequest(config: PathConfig) extends Bundle {
  val context = Context(config)
  val ray     = new TriangleRay(config.numbers)
  val hit     = new HitPoint(config)
  val face    = new Face(config.device)
}

/** A point of the environment, to be lit like a diffuse surface. */
final class EnvironmentSurface(config: PathConfig) extends Bundle {
  val context = Context(config)
  val point   = Vec3(new Fixed(new RayFormats(config.numbers).scene))
  val normal  = Vec3(SInt(NumberFormats.normalBits.W))
  val albedo  = Rgb(FrameRegisters.colour)
  val shadows = Bool() // send shadow rays
}

/** A diffuse surface and its direct light, before shadow rays from `origin` have been traced. */
final class LitSurface(config: PathConfig) extends Bundle {
  val context = Context(config)
  val albedo  = Rgb(FrameRegisters.colour)
  val origin  = Vec3(new Fixed(new RayFormats(config.numbers).scene))

  /** By light; 0 from a light that is off. */
  val directLight     = Vec(config.device.frame.lights, Rgb(FrameRegisters.intensity))
  val needsShadowRays = Vec(config.device.frame.lights, Bool())

  val emission =
    Option.when(config.device.frame.emission)(Rgb(FrameRegisters.colour)) // the light that the surface adds
  val scatter = Option.when(config.device.frame.gather)(ScatterStage.dir) // of the ray that gathers light there

  val isOfEnvironment = Bool()
}

/** A ray that leaves a mirror or glass. */
final class BouncedRay(config: PathConfig) extends Bundle {
  val bounce   = new BounceResult(config)
  val albedo   = Rgb(FrameRegisters.colour)
  val isTinted = Bool() // the path is tinted by the albedo

  /** Where there may be an environment: the origin of the Fresnel reflection, off the surface on the ray's side. */
  val fresnelOrigin = Option.when(config.device.hasEnvironment)(bounce.origin.cloneType)
}

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
