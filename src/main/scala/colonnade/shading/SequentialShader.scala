package colonnade.shading

import chisel3._
import chisel3.util.RegEnable
import colonnade.config.PathConfig
import colonnade.formats.{FrameRegisters, Material, MaterialKind, Rgb, Vec3}
import colonnade.numbers.{Fixed, Rounding}
import colonnade.ray.RayFormats

/** Shades hits: docs/numbers.md, 5 and 6. A hit on a diffuse surface gives the direct light of each light, with
  * Lambert's cosine and the light's falloff. A hit on a mirror or glass gives the outgoing ray.
  *
  * Hits of one kind leave in order. The geometry holds one hit, the cosine and direct units one light, and the bounce
  * unit one hit; geometry and direct unit share a multiplier. At 32b32s64d a hit with one light enters every 41 to 45
  * cycles (12 more if the smooth normal is zero) and leaves about 85 cycles later. Each further light takes 20 to 40
  * cycles. A surface that faces away from a light needs neither root nor quotient.
  *
  * A material's number is truncated to the bits that the table needs; beyond the table it means entry 0.
  */
final class SequentialShader(config: PathConfig) extends Shader(config) {
  private val formats = new ShaderFormats(config.numbers)
  private val scene   = new RayFormats(config.numbers).scene

  private val geometry   = Module(new ShaderGeometry(config))
  private val cosine     = Module(new CosineUnit(config.numbers))
  private val direct     = Module(new DirectUnit(config))
  private val multiplier =
    Module(new ShaderMultiplier(formats, config.device.geometry.cornerColours, ShaderMultiplier.latency(config)))

  // Geometry
  private val point    = geometry.io.result
  private val surface  = point.bits.surface
  private val material = Wire(new Material(config.device))
  material := ShadingPipeline.material(config, io.materials, surface.material)
  private val isBounce = material.kind.map(_ =/= MaterialKind.diffuse && !surface.isEnvironment).getOrElse(false.B)
  geometry.io.request <> io.request
  io.readyNext           := geometry.io.readyNext
  geometry.io.shading    := io.shading
  geometry.io.lights     := io.lights
  geometry.io.unitShift  := io.unitShift
  geometry.io.lightCount := Mux(isBounce, 1.U, io.shading.lights)

  // Colours of the hit's corners, or of the texel that they place, in the material's place; the hit waits for them
  private val isTextured = material.hasTexture.getOrElse(false.B)
  private val corners    = material.hasCornerColours.map { hasCornerColours =>
    val unit = Module(new CornerColours(config))
    unit.io.start   := io.request.fire
    unit.io.weights := io.request.bits.hit.weights
    unit.io.colours := io.request.bits.face.colours.get
    unit.io.isUsed  := (hasCornerColours || isTextured) && !surface.isEnvironment
    unit.io.product := multiplier.io.product
    multiplier.io.corners.get <> unit.io.operands
    unit
  }
  private val texture = corners.zip(io.texture).map { case (position, port) =>
    val unit = Module(new TextureLookup(config))
    unit.io.start         := io.request.fire
    unit.io.isKnown       := position.io.isDone && isTextured && !surface.isEnvironment
    unit.io.position      := position.io.colour
    io.isIllegalTexel.get := unit.io.isIllegal
    port <> unit.io.port
    unit
  }
  private val cornerAlbedo =
    corners.map(unit =>
      texture.map(texel => Mux(isTextured, texel.io.colour, unit.io.colour)).getOrElse(unit.io.colour)
    )
  private val objectAlbedo = corners.zip(cornerAlbedo).map { case (unit, colour) =>
    Mux(unit.io.isUsed, colour, material.albedo)
  }.getOrElse(material.albedo)

  // Albedo and shadows of an environment's point in the geometry
  private val environment = geometry.io.environment.zip(io.environment).map { case (taker, offered) =>
    taker <> offered
    RegEnable(offered.bits, offered.fire)
  }
  private val albedo =
    environment.map(point => Mux(surface.isEnvironment, point.albedo, objectAlbedo)).getOrElse(objectAlbedo)
  private val shadows =
    io.shading.shadows && environment.map(point => !surface.isEnvironment || point.shadows).getOrElse(true.B)

  // A light goes to the cosine unit. Its direct light is held with the surface until the last light is done
  private val isHeld = RegInit(false.B)
  private val light  = Reg(chiselTypeOf(point.bits.light))
  private val isLast = Reg(Bool())
  private val lit    = Reg(new LitSurface(config))
  private val isOn   = point.bits.light < io.shading.lights
  private val isFree = withAlbedo(!isHeld && cosine.io.angle.ready)
  cosine.io.angle.valid        := point.valid && !isBounce && isFree
  cosine.io.angle.bits         := point.bits.angle
  cosine.io.angle.bits.isAcute := point.bits.angle.isAcute && isOn
  cosine.io.falloff            := point.bits.falloff
  when(cosine.io.angle.fire) {
    val Seq(x, y, z) = surface.origin.axes.map(Fixed(scene, _))
    isHeld              := true.B
    light               := point.bits.light
    isLast              := point.bits.isLast
    lit.context         := surface.context
    lit.albedo          := albedo
    lit.origin          := Vec3.of(x, y, z)
    lit.isOfEnvironment := surface.isEnvironment
    for ((to, from) <- lit.emission.zip(material.emission); (channel, value) <- to.channels.zip(from.channels))
      channel := Mux(surface.isEnvironment, 0.U, value)
    when(point.bits.light === 0.U) {
      lit.directLight     := 0.U.asTypeOf(lit.directLight)
      lit.needsShadowRays := 0.U.asTypeOf(lit.needsShadowRays)
    }
    at(lit.needsShadowRays, point.bits.light) := shadows && point.bits.angle.isAcute && isOn
  }
  direct.io.brightness <> cosine.io.brightness
  direct.io.colour       := at(io.lights, light).colour
  direct.io.direct.ready := isHeld && (!isLast || io.lit.ready)
  when(direct.io.direct.fire) {
    isHeld                     := false.B
    at(lit.directLight, light) := direct.io.direct.bits
  }
  io.lit.valid                       := isHeld && isLast && direct.io.direct.valid
  io.lit.bits                        := lit
  at(io.lit.bits.directLight, light) := direct.io.direct.bits

  // Mirrors and glass
  private val bounces = io.bounced.map { bounced =>
    val unit     = Module(new BounceUnit(config))
    val albedo   = Reg(Rgb(FrameRegisters.colour))
    val isTinted = Reg(Bool())
    unit.io.offset               := io.shading.offset
    unit.io.request.valid        := withAlbedo(point.valid && isBounce)
    unit.io.request.bits.context := surface.context
    unit.io.request.bits.origin.axes.zip(surface.origin.axes).foreach { case (to, from) =>
      to := Rounding.narrow(from, to.getWidth)
    }
    unit.io.request.bits.normal            := surface.normal
    unit.io.request.bits.isSmooth          := surface.isSmooth
    unit.io.request.bits.faceForwardNormal := surface.faceForwardNormal
    unit.io.request.bits.dir               := surface.dir
    unit.io.request.bits.backSide          := surface.backSide
    unit.io.request.bits.isGlass           := material.kind.get === MaterialKind.glass
    unit.io.request.bits.eta               := Mux(surface.backSide, material.etaBack.get, material.etaFront.get)
    unit.io.request.bits.reflectance       := material.reflectance.get
    bounced.bits.fresnelOrigin.foreach(_ := RegEnable(unit.io.request.bits.origin, unit.io.request.fire))
    when(unit.io.request.fire) {
      albedo   := objectAlbedo
      isTinted := !surface.backSide || material.kind.get === MaterialKind.mirror
    }
    bounced.valid         := unit.io.result.valid
    bounced.bits.bounce   := unit.io.result.bits
    bounced.bits.albedo   := albedo
    bounced.bits.isTinted := isTinted
    unit.io.result.ready  := bounced.ready
    unit
  }
  point.ready := Mux(isBounce, bounces.map(unit => withAlbedo(unit.io.request.ready)).getOrElse(false.B), isFree)

  // Multiplier
  multiplier.io.geometry := geometry.io.operands
  multiplier.io.colour <> direct.io.operands
  geometry.io.product := multiplier.io.product
  direct.io.product   := multiplier.io.product

  io.busy := !geometry.io.request.ready

  /** The condition, once the hit's albedo is known. */
  private def withAlbedo(condition: Bool): Bool =
    corners.map { unit =>
      val isDone = texture.map(texel => Mux(isTextured, texel.io.isDone, unit.io.isDone)).getOrElse(unit.io.isDone)
      condition && (isDone || !unit.io.isUsed)
    }.getOrElse(condition)
}
