package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, RegEnable}
import colonnade.common.ModuloSchedule.{interval, xyz}
import colonnade.common.ModuloSchedule
import colonnade.config.PathConfig
import colonnade.formats.{Lobe, MaterialKind}
import colonnade.numbers.Rounding

/** Shades hits as [[SequentialShader]] does, bit for bit: a hit with one light every three cycles, and three cycles
  * more for each further light. {{{
  *
  * hit ─▶ SurfaceStage ─ normal, origin ─▶ AngleStage ─ angle, falloff ─▶ BrightnessStage ─ light ─┬▶ lit surface
  *           │   │                 └──────────────────────── queue of surfaces ────────────────────┘
  *           └───┴─ queue of bounces ─▶ BouncePipeline ─▶ bounced ray
  * }}}
  * The stages follow a [[colonnade.common.ModuloSchedule]] and never stall: a light on a hit enters only if it has a
  * place in the queues at the end. Lit surfaces leave in order, and so do bounced rays as far as their units allow. The
  * hit's point and normal are computed again for each light.
  */
final class ShadingPipeline(config: PathConfig) extends Shader(config) {
  import ShadingPipeline._

  private val cycles = new BrightnessCycles(config)

  private val phase    = RegInit(0.U.asTypeOf(ModuloSchedule.phase()))
  private val schedule = new ModuloSchedule(phase)
  import schedule._
  phase := Mux(isAt(interval - 1), 0.U, phase + 1.U)

  // The entry: a hit stays for all of its lights, one in each interval
  private val hit      = Reg(new ShadingHit(config))
  private val shadows  = Reg(Bool())
  private val isHeld   = RegInit(false.B)
  private val isActive = RegInit(false.B) // a light on the hit has just entered
  private val light    = Reg(UInt(log2Ceil(config.device.frame.lights.max(2)).W))
  private val isLast   = hit.isBounce || light +& 1.U >= io.shading.lights
  private val isFree   = !isHeld || (isActive && isLast)

  // Places at the end
  private val queued     = places(config)
  private val lightCount = RegInit(0.U(log2Ceil(queued + 1).W))
  private val hasPlace   = lightCount =/= queued.U
  private val mayBounce  = WireInit(true.B)
  private val isReady    = isFree && hasPlace && mayBounce
  private val isEnd      = isAt(interval - 1)
  private val takesPoint = io.environment.map(_.fire).getOrElse(false.B)
  private val enters     = io.request.fire || takesPoint
  private val entering   = entered(takesPoint)
  io.request.ready := isEnd && isReady
  io.environment.foreach(_.ready := isEnd && isReady && !io.request.valid)
  io.readyNext := isAt(interval - 2) && isReady
  when(isEnd) {
    isHeld   := enters || !isFree
    isActive := enters || (!isFree && hasPlace)
    light    := Mux(enters, 0.U, light + isActive)
  }
  when(enters) {
    hit     := entering
    shadows := io.shading.shadows && io.environment.map(port => !takesPoint || port.bits.shadows).getOrElse(true.B)
  }
  private val isCounted = isEnd && Mux(enters, !entering.isBounce, !isFree && hasPlace)

  // Stages
  private val slot = Wire(new LightSlot(config))
  slot.light   := light
  slot.isLast  := isLast
  slot.shadows := shadows
  slot.isOn    := light < io.shading.lights
  private val slots      = carry(arriving(slot, 0, interval - 1), 4)
  private val at5        = latch(4)(slots.at(4))
  private val at6        = carry(slots, 6)
  private val at17       = carry(at5, 17)
  private val atAngle    = carry(at17, cycles.angle)
  private val isLight    = arriving(isActive && !hit.isBounce, 0, interval - 1)
  private val lightAt6   = carryFlag(isLight, 6)
  private val lightAtEnd = carryFlag(lightAt6, cycles.direct)
  private val isBounce   = latchFlag(0)(isActive && hit.isBounce)
  private val surface    = Module(new SurfaceStage(config)).io
  private val angle      = Module(new AngleStage(config)).io
  private val bright     = Module(new BrightnessStage(config)).io
  surface.phase      := phase
  surface.offset     := io.shading.offset
  surface.hit        := hit
  angle.phase        := phase
  angle.lights       := io.lights
  angle.unitShift    := io.unitShift
  angle.light        := at5.at(xyz(5)).light
  angle.lightFalloff := at17.at(17).light
  angle.origin       := surface.origin
  angle.normal       := surface.normal
  bright.phase       := phase
  bright.angle       := angle.angle
  private val faces = angle.angle.isAcute && atAngle.at(cycles.angle until cycles.angle + interval).isOn
  bright.angle.isAcute := faces
  bright.falloff       := angle.falloff

  // Rough metal is lit about the direction in which a smooth mirror would reflect; a rough mirror or glass has
  // microfacets
  private val roughs = io.sample.map { sample =>
    // Known in the cycle after the entry, for all lights of the hit
    val isNew   = RegNext(enters, false.B)
    val hasLobe = Mux(isNew, sample.hasLobe, RegEnable(sample.hasLobe, isNew))
    val rough   = Wire(new RoughSurface(config))
    rough.isRough  := Mux(hit.isBounce, isRoughBounce, isRough(hit.material) && !hit.isEnvironment && hasLobe)
    rough.material := hit.material
    Seq.iterate(arriving(rough, 0, interval - 1), cycles.brightness / interval)(now =>
      latch(now.last)(now.at(now.last))
    )
  }

  /** The mirror or glass in the entry is rough, in a frame that gathers. */
  private def isRoughBounce: Bool =
    io.sample.fold(false.B)(_.isOn && material(config, io.materials, hit.material).lobe.get.alpha.orR)

  private def isRough(number: UInt): Bool =
    material(config, io.materials, number).kind.get === MaterialKind.roughMetal

  /** Whether a surface is rough metal, in each of these cycles; and its lobe. */
  private def roughAt(cycles: Seq[Int]): RoughSurface =
    select(cycles)(index => roughs.get(cycles(index) / interval).at(cycles(index)))

  /** Whether a hit on a rough mirror or glass is in the pipeline. */
  private def facetAt(cycles: Seq[Int]): Bool =
    select(cycles)(index => isFacet.get((cycles(index) - 1) / interval).at(cycles(index)))

  private def lobeAt(cycles: Seq[Int]): Lobe = material(config, io.materials, roughAt(cycles).material).lobe.get

  if (roughs.nonEmpty) {
    val stage = Module(new LobeAxisStage(config)).io
    stage.phase        := phase
    stage.isRough      := roughAt(Seq(0)).isRough && !hit.isBounce
    stage.dir          := surface.dir
    stage.normal       := surface.normal
    angle.normal       := stage.axis
    bright.isRough.get := roughAt(Seq(cycles.cosine)).isRough
    bright.slope.get   := lobeAt(cycles.cosine + 1 until cycles.cosine + 4).slope
    bright.peak.get    := lobeAt(Seq(cycles.cosine + 8)).peak
  }

  private val isFacet = roughs.map { _ =>
    val flag = latchFlag(0)(isActive && hit.isBounce && isRoughBounce)
    Seq.iterate(flag, ScatterStage.facet0 / interval + 1)(now => latchFlag(now.last)(now.at(now.last)))
  }

  // The rays that gather light, and microfacets
  private val scatter = io.sample.map { sample =>
    sample.read.valid := enters
    sample.read.bits  := entering.context
    sample.isBounce   := hit.isBounce
    sample.backSide   := hit.backSide
    val stage = Module(new ScatterStage(config)).io
    stage.phase             := phase
    stage.point             := sample.point
    stage.isBounce          := isBounce.at(xyz(1))
    stage.faceForwardNormal := surface.faceForwardNormal
    stage.dir               := surface.dir
    stage.axis              := angle.normal
    stage.squaredAxis       := angle.squaredNormal
    stage.alpha             := lobeAt(ScatterStage.rough until ScatterStage.rough + 3).alpha
    stage.isRough           := roughAt(Seq(ScatterStage.rough + 3)).isRough
    stage.isFacet           := facetAt(ScatterStage.rough + 3 until ScatterStage.rough + 6)
    stage
  }

  // Lit surfaces
  private val assembler = Module(new LitAssembler(config, queued)).io
  private val label     = assembler.label.bits
  assembler.materials   := io.materials
  assembler.label.valid := isAt(1) && isLight.at(1) && light === 0.U
  label.context         := hit.context
  label.material        := hit.material
  for (environment <- label.environment; port <- io.environment) {
    environment.valid := hit.isEnvironment
    environment.bits  := RegEnable(port.bits.albedo, enters)
  }
  for ((component, cycle) <- assembler.origin.zip(xyz(6))) {
    component.valid := isAt(cycle) && lightAt6.at(cycle) && at6.at(cycle).light === 0.U
    component.bits  := surface.origin
  }
  private val isFirst =
    carryFlag(arriving(isActive && !hit.isBounce && light === 0.U, 0, interval - 1), ScatterStage.dir0)
  for (components <- assembler.scatter; (component, cycle) <- components.zip(xyz(ScatterStage.dir0))) {
    component.valid := isAt(cycle) && isFirst.at(cycle)
    component.bits  := scatter.get.scatter
  }
  require(
    roughs.isEmpty || cycles.direct > xyz(ScatterStage.dir0).last,
    "lights come before the direction that gathers"
  )
  private val facing = latch(cycles.angle) {
    val now = WireInit(atAngle.at(cycles.angle))
    now.shadows := atAngle.at(cycles.angle).shadows && faces
    now
  }
  private val atColour = latch(cycles.colour - 1)(carry(facing, cycles.colour - 1).at(cycles.colour - 1))
  private val ended    = carry(atColour, cycles.direct).at(cycles.direct)
  bright.colour                       := at(io.lights, atColour.at(xyz(cycles.colour)).light).colour
  assembler.light.valid               := isAt(cycles.direct) && lightAtEnd.at(cycles.direct)
  assembler.light.bits.light          := ended.light
  assembler.light.bits.isLast         := ended.isLast
  assembler.light.bits.direct         := bright.direct
  assembler.light.bits.needsShadowRay := ended.shadows
  io.lit :<>= assembler.lit
  lightCount := lightCount + isCounted - assembler.isTaken

  // Mirrors and glass
  private val bounceAt7   = latchFlag(6)(carryFlag(isBounce, 6).at(6))
  private val bounceQueue = io.bounced.map { bounced =>
    val queue = Module(new BounceQueue(config, bouncePlaces)).io
    val pool  = Module(new BouncePipeline(config)).io
    val count = RegInit(0.U(log2Ceil(bouncePlaces + 1).W))
    queue.materials         := io.materials
    queue.hit.valid         := isAt(1) && isActive && hit.isBounce
    queue.hit.bits.context  := hit.context
    queue.hit.bits.material := hit.material
    queue.hit.bits.backSide := hit.backSide
    for (isRough <- queue.hit.bits.isRough; facet <- queue.facet) {
      isRough     := isRoughBounce
      facet.valid := isAt(ScatterStage.facet0) && facetAt(Seq(ScatterStage.facet0))
      facet.bits  := scatter.get.microfacet
    }
    for ((component, cycle) <- queue.directions.zip(xyz(1))) {
      component.valid                  := isAt(cycle) && isBounce.at(cycle)
      component.bits.faceForwardNormal := surface.faceForwardNormal
      component.bits.dir               := surface.dir
    }
    val point  = Rounding.narrow(surface.origin, queue.points.head.bits.origin.getWidth)
    val origin = delay(arriving(point, xyz(6)), xyz(6), 1).at(xyz(7))
    for ((component, cycle) <- queue.points.zip(xyz(7))) {
      component.valid         := isAt(cycle) && bounceAt7.at(cycle)
      component.bits.origin   := origin
      component.bits.normal   := surface.normal
      component.bits.isSmooth := surface.isSmooth
    }
    pool.offset := io.shading.offset
    pool.request :<>= queue.request
    queue.result :<>= pool.result
    bounced :<>= queue.bounced
    count     := count + (enters && entering.isBounce) - queue.request.fire
    mayBounce := count =/= bouncePlaces.U
    queue
  }
  io.busy := isActive

  // Colours of the corners, or texels at the positions that they hold
  private val albedos   = assembler.albedo +: bounceQueue.map(_.albedo).toSeq
  private val isOfKind  = Seq(lightAt6.at(8) && at6.at(8).light === 0.U, bounceAt7.at(8))
  private val atCorners = hit.colours.map { colours =>
    val corners = Module(new CornerStage(config)).io
    corners.phase   := phase
    corners.weights := hit.weights
    corners.colours := colours
    for ((albedo, isOfKind) <- albedos.zip(isOfKind); colour <- albedo.colour) {
      colour.valid := isAt(8) && isOfKind
      colour.bits  := corners.colour
    }
    corners.colour
  }
  for ((port, layout) <- io.texture.zip(config.device.geometry.texture)) {
    val texels     = Module(new TexelReader(config, 2 * queued)).io
    val isTextured =
      carry(latch(2)(material(config, io.materials, hit.material).hasTexture.get && !hit.isEnvironment), 8).at(8)
    texels.hit.valid           := isAt(8) && isTextured && isOfKind.reduce(_ || _)
    texels.hit.bits.position.x := atCorners.get.r >> layout.fractionBits
    texels.hit.bits.position.y := atCorners.get.g >> layout.fractionBits
    texels.hit.bits.isBounce   := isOfKind.last
    for ((albedo, texel) <- albedos.zip(Seq(texels.lit, texels.bounced)); port <- albedo.texel) port := texel
    port :<>= texels.port
    io.isIllegalTexel.get := texels.isIllegal
  }

  /** The hit that enters. A point of the environment enters as a hit at distance 0 with a geometric normal of its own.
    */
  private def entered(isPoint: Bool): ShadingHit = {
    val request = io.request.bits
    val to      = Wire(new ShadingHit(config))
    to.context       := request.context
    to.material      := request.face.material
    to.isEnvironment := isPoint
    to.isBounce      := !isPoint && material(config, io.materials, request.face.material).kind
      .map(MaterialKind.isSpecular).getOrElse(false.B)
    to.isFlat     := io.shading.flat || isPoint
    to.backSide   := request.hit.backSide
    to.axis       := request.ray.orientation.axis
    to.isNegative := request.ray.orientation.negative(2)
    to.origin     := VecInit(request.ray.origin.map(_.integer.pad(to.origin.head.getWidth)))
    to.shear      := VecInit(request.ray.shear.map(_.integer))
    to.distance   := request.hit.t.integer
    to.weights    := VecInit(request.hit.weights.map(_.natural))
    for ((colours, from) <- to.colours.zip(request.face.colours)) colours := from
    for ((normal, from) <- (to.normals :+ to.geometricNormal).zip(request.face.normals :+ request.face.geometricNormal))
      normal.axes.zip(from.axes).foreach { case (component, value) => component := value.integer }
    for (port <- io.environment) when(isPoint) {
      val point = port.bits
      to.context         := point.context
      to.backSide        := false.B
      to.axis            := 2.U
      to.isNegative      := false.B
      to.origin          := VecInit(point.point.axes.map(_.integer.pad(to.origin.head.getWidth)))
      to.shear           := 0.U.asTypeOf(to.shear)
      to.distance        := 0.S
      to.geometricNormal := point.normal
    }
    to
  }
}

object ShadingPipeline {
  val bouncePlaces: Int = 6 // mirrors and glass between the entry and their unit

  /** Lights between the entry and the lit surface: what the stages hold and some. */
  private def places(config: PathConfig): Int =
    1 << log2Ceil(new BrightnessCycles(config).direct / ModuloSchedule.interval + 4)

  /** The entry of a material's number, truncated to the bits that the table needs; beyond the table it means entry 0.
    */
  private[colonnade] def material[T <: Data](config: PathConfig, table: Vec[T], number: UInt): T = {
    val indexBits = log2Ceil(config.device.frame.materials)
    val entries   = table.padTo(1 << indexBits, table.head)
    if (indexBits == 0) entries.head else VecInit(entries)(number(indexBits - 1, 0))
  }
}
