package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Fill, MuxLookup, Valid}
import colonnade.common.ContextTable
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{FrameRegisters, Rgb, Shading}
import colonnade.numbers.{Fixed, Rounding}

final class ColourUnitIO(config: PathConfig) extends Bundle {
  val ambient    = Input(Rgb(FrameRegisters.intensity))
  val background = Input(Rgb(FrameRegisters.colour))
  val shading    = Input(new Shading(config))
  val surface    = Flipped(Valid(new LitSurface(config))) // the surface at which a context's path ends; remembered
  val bounce     = if (config.frame.hasBounces) Some(Flipped(Decoupled(new BounceUpdate(config)))) else None
  val end        = Flipped(Decoupled(new PathTermination(config)))
  val colour     = Valid(new PathColour(config))

  /** A path whose surface's light is added, and which goes on; the light cube. */
  val continued = Option.when(config.frame.gather)(Valid(new ContinuedPath(config)))
  val cube      = Option.when(config.frame.gather)(new LightPort(config))
}

/** Colours of paths: docs/numbers.md, 5.9 and 6. A path has a radiance so far, and a throughput that weights what it still
  * hits. A pipeline, a channel a cycle: docs/shading.md. {{{
  *
  * end ────┬▶ read ─▶ light · transmittance ─▶ sum of the lights ─▶ light · albedo  ─▶ throughput · colour ─▶ colour, path
  * bounce ─┘          throughput · tint                             tinted · Fresnel   part · behind
  * }}}
  * An end takes 3 · lights cycles, with the lights that are on, at least one; in the background 3. A bounce takes 3, and
  * 3 · lights more if its reflection shows a surface; none if it is the path's first and has no Fresnel reflection.
  * An end whose surface gathers light needs 3 cycles more, and gives no colour: the path goes on. Nor does an end of a ray
  * that a point of the environment gathers: its colour becomes the path's radiance.
  * Colours come in any order; the throughput and radiance of every path are in a table.
  *
  * @note colour = radiance + throughput · (emission + albedo · (ambient + the direct light of all lights · transmittance))
  */
final class ColourUnit(config: PathConfig) extends Module {
  private val lights     = config.frame.lights
  private val hasBounces = config.frame.hasBounces
  private val fraction   = NumberFormats.lightFraction
  private val colourBits = NumberFormats.colourBits
  private val sumBits    = NumberFormats.lightBits + log2Ceil(lights + 1)
  private val weightBits = fraction + 1
  private val one        = (1 << fraction).U(weightBits.W)

  val io = IO(new ColourUnitIO(config))

  // The operation: a bounce or an end; and the next one, while it is read
  private val isReading = RegInit(false.B)
  private val isIssuing = RegInit(false.B)
  private val next      = Reg(new ColourOperation(config))
  private val operation = Reg(new ColourOperation(config))
  import operation.{hasSurface, isBounce, needsRatio, occlusions}

  /** A slot of the operation is a channel and a light of its surface, or a channel of its path. */
  private val ofSurface = Reg(Bool())
  private val channel   = Reg(UInt(2.W))
  private val light     = Reg(UInt(log2Ceil(lights.max(2)).W))
  private val gathers   = operation.gathers.getOrElse(false.B)
  private val hasPasses = isBounce || gathers // first of its surface, then of its path
  private val lastPass  = !(hasPasses && ofSurface)

  private def isLastLight(light: UInt): Bool = !ofSurface || light +& 1.U >= io.shading.lights // off, it adds nothing

  private val lastLight   = isLastLight(light)
  private val lightThen   = Mux(lastLight, 0.U, light + 1.U)
  private val channelThen = Mux(!lastLight, channel, Mux(channel === 2.U, 0.U, channel + 1.U))
  private val isLast      = isIssuing && lastPass && channel === 2.U && lastLight
  private val endsNext    = isIssuing && lastPass && channelThen === 2.U && isLastLight(lightThen)

  // Take one while the last slot is issued, or in the cycle before
  private val isFree    = !isReading && (!isIssuing || isLast || endsNext)
  private val isWriting = Wire(Bool())

  /** The path's first bounce, without a Fresnel reflection: its tint is the throughput. It needs no slot. */
  private val isDirect =
    io.bounce.map(bounce => bounce.bits.isFirst && bounce.bits.fresnel.natural === 0.U).getOrElse(false.B)
  private val mayBounce = io.bounce.map(_.valid && !isDirect).getOrElse(false.B)
  private val bounces   = mayBounce && isFree
  private val takes     = bounces || io.end.fire
  private val isOfRoom  = io.end.bits.isOfEnvironment.getOrElse(true.B) || bounces
  private val taken = Mux(mayBounce, io.bounce.map(_.bits.context).getOrElse(io.end.bits.context), io.end.bits.context)
  private val tints = io.bounce.map { bounce =>
    bounce.bits.albedo.channels.map(albedo => Mux(bounce.bits.isTinted, albedo +& albedo(colourBits - 1), one))
  }
  io.bounce.foreach(_.ready := Mux(isDirect, !isWriting, isFree))
  io.end.ready := isFree && !mayBounce
  private val meetsCube = Mux(
    bounces,
    io.bounce.flatMap(_.bits.showsCube).getOrElse(false.B),
    io.end.bits.isBackground && io.end.bits.endsInCube.getOrElse(false.B)
  )
  for (port <- io.cube) {
    port.read.valid             := (bounces || io.end.fire) && meetsCube
    port.read.bits.context      := taken
    port.read.bits.seesLights   := bounces || !io.end.bits.isScattered.get
    port.read.bits.isReflection := bounces
  }
  when(takes) {
    next.context    := taken
    next.isBounce   := bounces
    next.isStraight :=
      io.bounce.map(bounce => Mux(bounces, bounce.bits.isFirst, io.end.bits.isStraight.get)).getOrElse(true.B)
    next.occlusions := io.end.bits.occlusions
    when(bounces) { next.occlusions.foreach(_ := Occlusion.none) }
    val showsSurface = Mux(bounces, io.bounce.flatMap(_.bits.hasSurface).getOrElse(false.B), !io.end.bits.isBackground)
    next.hasSurface := showsSurface
    val isDirectView = !bounces && io.end.bits.isDirectView.getOrElse(false.B)
    val hasGathered  = isDirectView && isOfRoom && !io.end.bits.isStraight.getOrElse(true.B)
    next.needsRatio := isDirectView && isOfRoom && showsSurface &&
      (io.end.bits.occlusions.map(_ =/= Occlusion.none).reduce(_ || _) || hasGathered)
    next.hasGathered.foreach(_ := hasGathered)
    for (to <- next.goesBack; gathers <- io.end.bits.gathers) to := isDirectView && !isOfRoom && !gathers
    for (to <- next.gathers; from <- io.end.bits.gathers) to     := !bounces && from
    next.showsCube.foreach(_ := meetsCube)
    next.fresnel.foreach(_.raw := 0.U)
    for (bounce <- io.bounce) when(bounces) {
      next.fresnel.get := bounce.bits.fresnel
      next.tint.get.zip(tints.get).foreach { case (to, tint) => to := Fixed(to.format, tint) }
    }
  }

  // Its slots follow those of the operation before. Its path is read again and again while a bounce of the same path is
  // under way, or while the ratio unit is busy
  private val isUpdating = Wire(Bool())
  private val ratios     = Option.when(config.hasEnvironment)(Module(new ShadowRatios(config, sumBits)).io)
  private val starts     = isReading && !isUpdating && !(next.needsRatio && ratios.map(_.busy).getOrElse(false.B))
  private val repeats    = isReading && !starts
  private val reads      = takes || repeats
  assert(!starts || !isIssuing || isLast, "an operation before the end of another one")
  isReading := reads
  when(isIssuing) {
    light   := lightThen
    channel := channelThen
    when(lastLight && channel === 2.U && hasPasses) { ofSurface := false.B }
  }
  when(starts) {
    isIssuing := true.B
    operation := next
    ofSurface := next.hasSurface
    channel   := 0.U
    light     := 0.U
  }.elsewhen(isLast) { isIssuing := false.B }
  ratios.foreach(_.claim := starts && next.needsRatio)

  private val surfaces    = ContextTable(config, new TerminalSurface(config))
  private val surface     = surfaces.read(taken, takes)
  private val albedo      = Reg(Vec(3, UInt(colourBits.W)))
  private val directLight = Reg(Vec(lights, Vec(3, UInt(NumberFormats.lightBits.W))))
  private val emission    = Option.when(config.frame.emission)(Reg(Vec(3, UInt(colourBits.W))))
  when(io.surface.valid) {
    val surface = Wire(new TerminalSurface(config))
    surface.albedo      := io.surface.bits.albedo
    surface.directLight := io.surface.bits.directLight
    surface.emission.zip(io.surface.bits.emission).foreach { case (to, from) => to := from }
    surfaces.write(io.surface.bits.context, surface)
  }
  when(RegNext(takes, false.B)) {
    albedo      := VecInit(surface.albedo.channels)
    directLight := VecInit(surface.directLight.map(light => VecInit(light.channels.map(_.natural))))
    emission.zip(surface.emission).foreach { case (to, from) => to := VecInit(from.channels) }
  }

  private val paths      = Option.when(hasBounces)(ContextTable(config, new PathState))
  private val throughput = if (hasBounces) Reg(Vec(3, UInt(weightBits.W))) else VecInit.fill(3)(one)
  private val radiance   = if (hasBounces) Reg(Vec(3, UInt(colourBits.W))) else VecInit.fill(3)(0.U(colourBits.W))
  for (path <- paths.map(_.read(Mux(repeats, next.context, taken), reads)))
    when(starts) {
      val isNew = next.isStraight || next.hasGathered.getOrElse(false.B)
      throughput := VecInit(path.throughput.map(weight => Mux(isNew, one, weight.natural)))
      radiance   := VecInit(path.radiance.channels.map(Mux(next.isStraight, 0.U, _)))
    }

  private def of[T <: Data](channels: Seq[T], channel: UInt = channel): T =
    MuxLookup(channel, channels(2))(Seq(0.U -> channels(0), 1.U -> channels(1)))

  private def background(slot: ColourSlot): UInt = {
    val register = of(io.background.channels, slot.channel)
    slot.cube.fold(register)(cube => Mux(cube.valid, cube.bits, register))
  }

  private def at[T <: Data](entries: Vec[T]): T = if (lights == 1) entries.head else entries(light)

  private def drop(product: UInt, width: Int): UInt = Rounding.narrow(Rounding.floor(product, fraction), width)

  /** The slot, one stage later. */
  private def after(slot: ColourSlot)(change: ColourSlot => Unit = _ => ()): ColourSlot = {
    val now = WireInit(slot)
    change(now)
    val later = WireInit(RegNext(now))
    later.isValid := RegNext(now.isValid, false.B)
    later
  }

  // Light that arrives at the surface from a light, or the tinted throughput
  private val slot = Wire(new ColourSlot(config))
  slot.isValid      := isIssuing
  slot.context      := operation.context
  slot.isLast       := isLast
  slot.isPath       := lastPass || gathers
  slot.isBounce     := isBounce || (gathers && !ofSurface)
  slot.hasSurface   := hasSurface
  slot.needsRatio   := needsRatio
  slot.channel      := channel
  slot.isFirstLight := light === 0.U
  slot.isLastLight  := lastLight
  slot.radiance     := of(radiance)
  slot.weight       := of(throughput)
  slot.emission.zip(emission).foreach { case (to, from) => to := of(from) }
  private val shadowTransmittance = io.shading.shadowTransmittance.map(_.natural).getOrElse(one)
  private val transmittance       =
    MuxLookup(at(occlusions), 0.U)(Seq(Occlusion.none -> one, Occlusion.transmissive -> shadowTransmittance))
  for (cube <- slot.cube) {
    cube.valid := operation.showsCube.get
    cube.bits  := DontCare
  }
  slot.gathers.foreach(_ := gathers)
  for ((to, from) <- slot.goesBack.zip(operation.goesBack) ++ slot.hasGathered.zip(operation.hasGathered)) to := from
  private val tint = operation.tint
    .map(tint => Mux(gathers, of(albedo) +& of(albedo)(colourBits - 1), of(tint.map(_.natural))))
    .getOrElse(one)
  private val fresnel  = operation.fresnel.map(_.natural).getOrElse(0.U(weightBits.W))
  private val direct   = of(at(directLight))
  private val arriving = Reg(UInt(NumberFormats.lightBits.W))
  arriving :=
    drop(Mux(ofSurface, direct, of(throughput)) * Mux(ofSurface, transmittance, tint), NumberFormats.lightBits)

  // The sum of the lights
  private val arrival  = after(slot)()
  private val lit      = Reg(UInt(sumBits.W))
  private val all      = Reg(UInt(sumBits.W))
  private val ambient  = of(io.ambient.channels, arrival.channel).natural
  private val indirect = Mux(
    arrival.gathers.getOrElse(false.B),
    0.U,
    Mux(arrival.hasGathered.getOrElse(false.B), arrival.radiance, ambient)
  )
  lit := Mux(arrival.isBounce && arrival.isPath, 0.U, Mux(arrival.isFirstLight, indirect, lit)) + arriving
  all := Mux(arrival.isFirstLight, ambient, all) + RegNext(direct)

  // The light that leaves the surface, or the weight of the Fresnel reflection
  private val sum = after(arrival) { slot =>
    slot.isValid := arrival.isValid && arrival.isLastLight
    when(arrival.hasGathered.getOrElse(false.B)) { slot.radiance := 0.U }
  }
  private val factors   = Reg(Vec(2, UInt(weightBits.W)))
  private val reflected = Reg(UInt((sumBits + weightBits - fraction).W))
  factors   := VecInit(Mux(ofSurface, of(albedo), fresnel), factors(0))
  reflected := Rounding.floor(lit * factors(1), fraction)
  for (ratios <- ratios) {
    ratios.load.valid        := sum.isValid && sum.needsRatio
    ratios.load.bits.part    := lit
    ratios.load.bits.channel := sum.channel
    ratios.whole             := all
  }

  // Its colour
  private val leaving = {
    val slot = WireInit(after(sum)(slot => when(sum.isBounce) { slot.weight := Rounding.narrow(lit, weightBits) }))
    for (cube <- slot.cube; texel <- io.cube.map(_.texel)) {
      val radiance = texel.radiance(of(texel.mantissas.channels, slot.channel))
      cube.bits := Mux(texel.isLight, Fill(NumberFormats.lightBits, 1.U(1.W)), radiance)
    }
    slot
  }
  private val colour = Rounding.saturate(reflected, colourBits)
  private val shown  =
    leaving.emission.map(emission => Rounding.saturate(colour +& emission, colourBits)).getOrElse(colour)
  private val seenBits = if (config.frame.gather) NumberFormats.lightBits else weightBits
  private val seen     = Reg(UInt(seenBits.W))
  seen := Mux(
    leaving.isBounce && leaving.isPath,
    Rounding.narrow(reflected, weightBits),
    Mux(leaving.hasSurface, shown, background(leaving))
  )
  private val reflection = Reg(Vec(3, UInt(colourBits.W)))
  when(leaving.isValid && !leaving.isPath) { shiftIn(reflection, shown) }

  // What the path shows of it, and still lets through
  private val weighed = after(leaving)(slot => slot.isValid := leaving.isValid && leaving.isPath)
  private val weight  =
    if (hasBounces)
      Mux(
        weighed.isBounce,
        Mux(weighed.hasSurface, of(reflection, weighed.channel), background(weighed)),
        weighed.weight
      )
    else weighed.weight
  private val part = Reg(UInt(seenBits.W))
  part := drop(seen * weight, seenBits)

  // The path's colour so far
  private val added   = after(weighed)(slot => slot.weight := weighed.weight - seen(weightBits - 1, 0))
  private val colours = Reg(Vec(3, UInt(colourBits.W)))
  private val weights = Reg(Vec(3, UInt(weightBits.W)))
  when(added.isValid) {
    // The second pass of a path that gathers leaves the colour alone
    when(!(added.isBounce && added.gathers.getOrElse(false.B))) {
      shiftIn(colours, Rounding.saturate(added.radiance +& part, colourBits))
    }
    shiftIn(weights, added.weight)
  }

  // An end's colour leaves, or waits for its ratio, or becomes the radiance that a point of the environment gathers
  private val done     = after(added)(slot => slot.isValid := added.isValid && added.isLast)
  private val goesBack = done.goesBack.getOrElse(false.B)
  private val isShown  = done.isValid && !done.isBounce && !done.needsRatio && !goesBack
  private val goesOn   = done.isValid && ((done.isBounce && done.gathers.getOrElse(false.B)) || goesBack)
  private val result   = Wire(new PathColour(config))
  result.context := done.context
  result.colour.channels.zip(colours).foreach { case (to, from) => to := from }
  result.ratio.foreach(_.channels.foreach(to => to := Fixed(to.format, one)))
  io.colour.valid := isShown
  io.colour.bits  := result
  for (ratios <- ratios) {
    ratios.colour.valid := done.isValid && done.needsRatio
    ratios.colour.bits  := result
    ratios.result.ready := !isShown && !goesOn
    when(ratios.result.ready) {
      io.colour.valid := ratios.result.valid
      io.colour.bits  := ratios.result.bits
    }
  }

  // A bounce's path enters the table; a read in the same cycle does not count
  isWriting := done.isValid && (done.isBounce || goesBack)
  for (continued <- io.continued) {
    continued.valid        := goesOn
    continued.bits.context := done.context
    continued.bits.isBack.foreach(_ := goesBack)
  }
  for (table <- paths; bounce <- io.bounce) when(isWriting || (bounce.fire && isDirect)) {
    val path = Wire(new PathState)
    for ((to, (weight, tint)) <- path.throughput.zip(weights.zip(tints.get)))
      to := Fixed(to.format, Mux(isWriting, weight, tint))
    path.radiance.channels.zip(colours).foreach { case (to, from) => to := Mux(isWriting, from, 0.U) }
    table.write(Mux(isWriting, done.context, bounce.bits.context), path)
  }
  isUpdating := Seq(slot, arrival, sum, leaving, weighed, added, done, after(done)())
    .map(slot => slot.isValid && slot.isBounce && slot.context === next.context)
    .reduce(_ || _)

  private def shiftIn(channels: Vec[UInt], value: UInt): Unit = {
    channels(0) := channels(1)
    channels(1) := channels(2)
    channels(2) := value
  }
}

/** The surface at which a path ends. */
final private class TerminalSurface(config: PathConfig) extends Bundle {
  val albedo      = Rgb(FrameRegisters.colour)
  val directLight = Vec(config.frame.lights, Rgb(FrameRegisters.intensity))
  val emission    = if (config.frame.emission) Some(Rgb(FrameRegisters.colour)) else None
}

/** A path after its bounces so far. */
final private class PathState extends Bundle {
  val throughput = Vec(3, FrameRegisters.weight) // the weight of what the path still hits, by channel
  val radiance   = Rgb(FrameRegisters.colour)    // the colour so far
}
